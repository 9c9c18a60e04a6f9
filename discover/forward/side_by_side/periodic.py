"""Sweeps of many vectors of parameters: every oscillation in steady alternation is a lane."""

from collections.abc import Callable
from dataclasses import replace

import jax
import numpy as np
from jaxtyping import Bool, Float

from discover.effects import KinematicEffect
from discover.forward.augmented_fluid import AugmentedFluid
from discover.forward.batches import PeriodicFlows, Records
from discover.forward.side_by_side.code import Eights, in_whole_eights, lanes_last
from discover.forward.side_by_side.periodic_code import PeriodicCode
from discover.forward.side_by_side.step import Flags
from discover.forward.structure import Numbers
from discover.programs import compiled, in_threads
from discover.programs.lanes import LANES

# Eights of states that one call of the code takes
_AT_ONCE = 2


class PeriodicSideBySide:
    """Predictions of moduli for one structure of law and effects.

    `fluid`, `code`: the fluid with its effects, and its machine code. `rates`: of a vector, the
    effects that are present, and states: the amplitude of the rate that the fluid feels.
    `recorded`: of the numbers, these and the moduli of the modes, the moduli recorded. `made_from`:
    what tells these from those of another structure.
    """

    def __init__(
        self,
        fluid: AugmentedFluid,
        code: PeriodicCode,
        rates: Callable,
        recorded: Callable,
        made_from: tuple,
    ):
        self._fluid, self._code, self._flags = fluid, code, Flags(fluid)
        acting = [e for e in fluid.structure.effects if e.acts_on_steady_states]
        at = fluid.slices
        self._shaping = [at[e.name].start for e in acting if isinstance(e, KinematicEffect)]
        coupling = [*fluid.series, *(e for e in fluid.states if e.acts_on_steady_states)]
        self._coupling = [at[e.name].start for e in coupling]

        self._packed = code.packing(fluid, made_from, 0)
        of_trials = jax.vmap(rates, (0, None, None))
        self._rates = compiled(of_trials, ("periodic rates", *made_from))

        def of_solvent(numbers: Numbers, solvent, *others):
            return recorded(replace(numbers, solvent_viscosity=solvent), *others)

        of_trials = jax.vmap(of_solvent, (None, 0, 0, None, None, 0))
        self._recorded = compiled(of_trials, ("moduli", *made_from))

    def alone(self, thetas: Float[np.ndarray, "trials p"]) -> Bool[np.ndarray, " trials"]:
        """Return which vectors are left to the other program.

        In those a state of the fluid changes with the modes, or something gives way in series.
        """
        return np.any(thetas[:, self._coupling], axis=1)

    def predict(
        self,
        numbers: Numbers,
        thetas: Float[np.ndarray, "trials p"],
        moduli: Float[np.ndarray, "trials c"],
        limits: Float[np.ndarray, " trials"],
        part: PeriodicFlows,
        judging: Records | None,
        runs: int,
        normal: bool,
    ) -> Float[np.ndarray, "trials states 2"]:
        """Return both moduli; see `SideBySide.predict`.

        Limits, what judges and how many runs are no padding say nothing here, and a modulus has no
        normal stresses beside it.
        """
        del limits, judging, runs, normal
        count, frequency = len(thetas), np.asarray(part.frequency)
        present = self._fluid.present(thetas)
        eights = Eights.of(self._packed, numbers, thetas, moduli)
        is_shaped = np.any(thetas[:, self._shaping])
        shaped = (lambda eight: self._rates(eight, present, part)) if is_shaped else None
        rate = eights.rates(frequency * np.asarray(part.strain), shaped)
        found = self._solved(thetas, eights, len(numbers.modulus), rate / frequency, part)
        places = np.split(in_whole_eights(count), len(eights.pairs))
        recorded = [
            self._recorded(numbers, own[:, -1], eight, present, part, found[at])
            for (eight, own), at in zip(eights.pairs, places, strict=True)
        ]
        return np.concatenate(recorded)[:count]

    def _solved(self, thetas, eights: Eights, declared: int, strain, part) -> np.ndarray:
        """Return the complex moduli of the modes, shape (trials, states)."""
        frequency, steps = np.asarray(part.frequency), np.asarray(part.steps).astype(np.int64)
        patterns, which = np.unique(self._flags.of(thetas), axis=0, return_inverse=True)
        out = np.empty((len(thetas), len(frequency)), complex)

        def some(lanes: tuple[np.ndarray, np.ndarray]) -> None:
            trial, state = (lane[in_whole_eights(len(lane))] for lane in lanes)
            own = steps[state[::LANES]]
            half = np.arange(2 * own.max() + 1) * (0.5 * np.pi / own[:, None])

            of_mode = eights.modes[trial]
            # what effects add is left out where no lane has it
            present = np.any(of_mode[:, :, 0] != 0.0, axis=0)
            present[:declared] = True
            given = {
                "strain": lanes_last(strain[trial, state]),
                "frequency": lanes_last(frequency[state]),
                "shared": lanes_last(eights.shared[trial]), "mode": lanes_last(of_mode[:, present]),
                "steps": own, "cosine": np.cos(half), "sine": np.sin(half),
            }  # fmt: skip
            found = self._code(patterns[which.ravel()[trial[0]]], given)
            out[trial, state] = found.ravel()

        pieces = []
        for number in range(len(patterns)):
            trials = np.flatnonzero(which.ravel() == number)
            # those of a group take as many steps
            for count in np.unique(steps):
                states = np.flatnonzero(steps == count)
                trial, state = np.repeat(trials, len(states)), np.tile(states, len(trials))
                for first in range(0, len(trial), _AT_ONCE * LANES):
                    piece = slice(first, first + _AT_ONCE * LANES)
                    pieces.append((trial[piece], state[piece]))
        in_threads(some, pieces, is_compiled=True)
        return out
