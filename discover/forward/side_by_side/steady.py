"""Flow curves of many vectors of parameters: every steady state is a lane of its own."""

from collections.abc import Callable

import jax
import numpy as np
from jaxtyping import Float

from discover.effects import KinematicEffect, SignalEffect
from discover.forward.augmented_fluid import AugmentedFluid
from discover.forward.batches import Records, SteadyFlows
from discover.forward.side_by_side.code import Eights, in_whole_eights, lanes_last
from discover.forward.side_by_side.steady_code import SteadyCode
from discover.forward.side_by_side.step import Flags
from discover.forward.structure import Numbers
from discover.programs import compiled, in_threads
from discover.programs.lanes import LANES
from discover.protocols.kinematics import normal_stress_differences

# Eights of states that one call of the code takes
_AT_ONCE = 8


class SteadySideBySide:
    """Predictions of flow curves for one structure of law and effects.

    `fluid`, `code`: the fluid with its effects, and its machine code. `rates`: of a vector, the
    effects that are present, and a run: the felt rate without slip. `recorded`: of these, the
    stress and the felt rate, what is recorded. `made_from`: what tells these from those of another
    structure.
    """

    def __init__(
        self,
        fluid: AugmentedFluid,
        code: SteadyCode,
        rates: Callable,
        recorded: Callable,
        made_from: tuple,
    ):
        self._fluid, self._code, self._flags = fluid, code, Flags(fluid)
        acting = [e for e in fluid.structure.effects if e.acts_on_steady_states]
        self._shaping = [
            fluid.slices[e.name].start for e in acting if isinstance(e, KinematicEffect)
        ]
        self._distorting = [
            fluid.slices[e.name].start for e in acting if isinstance(e, SignalEffect)
        ]

        self._packed = code.packing(fluid, made_from, 0)
        of_runs = jax.vmap(rates, in_axes=(None, None, 0))
        of_trials = jax.vmap(of_runs, in_axes=(0, None, None))
        self._rates = compiled(of_trials, ("steady rates", *made_from))
        of_runs = jax.vmap(recorded, in_axes=(None, None, 0, 0, 0))
        of_trials = jax.vmap(of_runs, in_axes=(0, None, None, 0, 0))
        self._recorded = compiled(of_trials, ("steady records", *made_from))

    def predict(
        self,
        numbers: Numbers,
        thetas: Float[np.ndarray, "trials p"],
        moduli: Float[np.ndarray, "trials c"],
        limits: Float[np.ndarray, " trials"],
        part: SteadyFlows,
        judging: Records | None,
        runs: int,
        normal: bool,
    ) -> Float[np.ndarray, "trials runs n kinds"]:
        """Return what is recorded; see `SideBySide.predict`.

        Limits, what judges and how many runs are no padding say nothing here.
        """
        del limits, judging, runs
        count, present = len(thetas), self._fluid.present(thetas)
        eights = Eights.of(self._packed, numbers, thetas, moduli)
        is_shaped = np.any(thetas[:, self._shaping])
        shaped = (lambda eight: self._rates(eight, present, part)) if is_shaped else None
        rate = eights.rates(np.asarray(part.rate), shaped)
        found = self._states(thetas, eights, len(numbers.modulus), rate, part)
        stress, felt, of_modes = found[..., 0], found[..., 1], found[..., 2:]
        beside = []
        if normal:
            beside = [normal_stress_differences(part.kinematics, stress, of_modes)]
        if not np.any(thetas[:, self._distorting]):
            return np.concatenate([stress[..., None], *beside], axis=-1)
        places = np.split(in_whole_eights(count), len(eights.pairs))
        recorded = [
            self._recorded(eight, present, part, stress[at], felt[at])
            for (eight, _), at in zip(eights.pairs, places, strict=True)
        ]
        return np.concatenate([np.concatenate(recorded)[:count, ..., None], *beside], axis=-1)

    def _states(self, thetas, eights: Eights, declared: int, rate, part) -> np.ndarray:
        """Return stresses, felt rates and those of the modes, shape (trials, runs, n, 6)."""
        own = np.asarray(part.rate)
        # behind the last there are copies of it
        changes = np.diff(own, axis=1) != 0.0
        last = own.shape[1] - 1 - np.argmax(changes[:, ::-1], axis=1) if changes.size else 0
        last = np.where(np.any(changes, axis=1), last, 0)
        place = np.minimum(np.arange(own.shape[1]), last[:, None])
        of_run, at = np.nonzero(np.arange(own.shape[1]) <= last[:, None])
        leaves = [np.asarray(leaf) for leaf in jax.tree.leaves(part.kinematics)]
        flows = (
            np.concatenate([leaf.reshape(len(own), -1) for leaf in leaves], 1) if leaves else None
        )
        flags = self._flags.of(thetas)
        patterns, which = np.unique(flags, axis=0, return_inverse=True)
        out = np.empty((len(thetas), *own.shape, 6))

        def some(lanes: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
            pattern, trial, state = lanes
            filled = in_whole_eights(len(trial))
            trial, state = trial[filled], state[filled]
            row, column = of_run[state], at[state]

            of_mode = eights.modes[trial]
            # what effects add is left out where no lane has it
            present = np.any(of_mode[:, :, 0] != 0.0, axis=0)
            present[:declared] = True
            given = {
                "rate": lanes_last(rate[trial, row, column]),
                "shared": lanes_last(eights.shared[trial]),
                "mode": lanes_last(of_mode[:, present]),
                "flow": np.zeros(1) if flows is None else lanes_last(flows[row]),
            }
            stress, felt, of_modes = self._code(patterns[pattern[0]], given)
            found = [stress[:, None], felt[:, None], of_modes]
            found = np.moveaxis(np.concatenate(found, axis=1), 1, -1)
            out[trial, row, column] = found.reshape(-1, 6)

        pieces = []
        for number in range(len(patterns)):
            trials = np.flatnonzero(which.ravel() == number)
            trial = np.repeat(trials, len(of_run))
            state = np.tile(np.arange(len(of_run)), len(trials))
            for first in range(0, len(trial), _AT_ONCE * LANES):
                piece = slice(first, first + _AT_ONCE * LANES)
                pieces.append((np.array([number]), trial[piece], state[piece]))
        in_threads(some, pieces, is_compiled=True)
        return np.take_along_axis(out, place[None, :, :, None], axis=2)
