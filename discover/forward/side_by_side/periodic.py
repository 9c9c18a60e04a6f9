"""Sweeps of many vectors of parameters: every oscillation in steady alternation is a run."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float

from discover.effects import KinematicEffect
from discover.forward.augmented_fluid import AugmentedFluid
from discover.forward.declared import Numbers
from discover.forward.side_by_side.kernel import Kernel
from discover.forward.side_by_side.predictors import (
    Asked,
    StatePredictor,
    flows_of,
    in_whole_eights,
)
from discover.forward.side_by_side.step import WEIGHTS
from discover.programs.lanes import LANES

# Of the secant most steps, the relative change of the strain that ends it, and its bounds
_MOST_SECANTS, _TOLERANCE, _SECANT = 40, 1e-8, (0.2, 5.0)


class PeriodicSideBySide(StatePredictor):
    """Predictions of moduli for one structure of law and effects.

    `code`: of transients that begin with a cycle, of which each state is one. `rates`: as of
    `StatePredictor`. `given_way`, `recorded`: of a vector, states, felt strains and moduli of the
    modes: by how much the tool turns further than the fluid; and with the felt rates, what is
    recorded.
    """

    def __init__(
        self,
        fluid: AugmentedFluid,
        code: Kernel,
        rates: Callable,
        given_way: Callable,
        recorded: Callable,
    ):
        acting = [e for e in fluid.structure.effects if e.acts_on_steady_states]
        shaping = [e for e in acting if isinstance(e, KinematicEffect)]
        super().__init__(fluid, code, shaping, rates)
        self._series = self._amplitudes(fluid.series)
        others = self._amplitudes(e for e in fluid.states if not e.acts_on_steady_states)
        self._still = [*others, *self._series]

        def of_solvent(function: Callable) -> Callable:
            def of(numbers: Numbers, solvent, *others):
                return function(replace(numbers, solvent_viscosity=solvent), *others)

            return of

        self._given_way = self._program(of_solvent(given_way), (None, 0, 0, None, 0, 0))
        self._recorded = self._program(of_solvent(recorded), (None, 0, 0, None, None, 0, 0, 0))

    def predict(self, asked: Asked) -> Float[np.ndarray, "trials states 2"]:
        """Return both moduli."""
        part = asked.part
        rate = self._felt(asked, (part.frequency * part.strain)[None])[:, 0]
        strain, of_modes = self._answered(asked, rate / part.frequency)
        present = self._fluid.present(asked.thetas)
        return self._of_eights(
            asked, lambda own, at: self._recorded(
                asked.numbers, own.moduli[:, -1], own.thetas, present, part, strain[at],
                of_modes[at], rate[at],
            ),
        )  # fmt: skip

    def _of_eights(self, asked: Asked, of: Callable[[Asked, np.ndarray], Any]) -> np.ndarray:
        """Return what is found of eight vectors at a time, and where these stand."""
        count = len(asked.thetas)
        each = in_whole_eights(count).reshape(-1, LANES)
        return np.concatenate([of(asked.taken(at), at) for at in each])[:count]

    def _answered(self, asked: Asked, strain: Float[np.ndarray, "trials states"]):
        """Return the strain that the fluid feels of the tool's, and the moduli of its modes.

        What gives way in series takes its share of the first harmonic alone. The secant finds the
        amplitude that is left, along the logarithms of both.
        """
        felt, of_modes = strain.copy(), self._of_modes(asked, strain)
        trials = np.flatnonzero(np.any(asked.thetas[:, self._series], axis=1))
        before, lacked = felt.copy(), np.zeros(felt.shape)
        for _ in range(_MOST_SECANTS):
            if not len(trials):
                break
            own = asked.taken(trials)
            now, found = felt[trials], of_modes[trials]

            def further(eight: Asked, at: np.ndarray, now=now, found=found):
                solvent = eight.moduli[:, -1]
                return self._given_way(
                    eight.numbers, solvent, eight.thetas, eight.part, now[at], found[at]
                )

            taken = self._of_eights(own, further)
            lacking = np.log(strain[trials] / now) - np.log(np.abs(taken))
            passed = np.log(now / before[trials])
            moved = passed != 0.0
            slope = (lacked[trials] - lacking) / np.where(moved, passed, 1.0)
            # 1 of a linear fluid; small of one that thins and gives way
            slope = np.where(moved, np.clip(slope, *_SECANT), 1.0)
            change = lacking / slope
            before[trials], lacked[trials] = now, lacking
            felt[trials] = now * np.exp(change)
            trials = trials[np.any(np.abs(change) > _TOLERANCE, axis=1)]
            if len(trials):
                of_modes[trials] = self._of_modes(asked.taken(trials), felt[trials])
        of_modes[trials] = np.nan
        return felt, of_modes

    def _of_modes(self, asked: Asked, strain: Float[np.ndarray, "trials states"]) -> np.ndarray:
        """Return the complex moduli of the modes, shape (trials, states), each state a run."""
        part, steps = asked.part, asked.part.steps.astype(np.int64)
        frequency, most = part.frequency, int(np.max(steps))
        thetas = asked.thetas.copy()
        thetas[:, self._still] = 0.0
        width = np.repeat((np.pi / (frequency * steps))[:, None], most, axis=1)
        phase = np.arange(2 * most + 1) * (0.5 * np.pi / steps[:, None])
        wave = frequency[:, None] * np.cos(phase)
        # of what is periodic the sum over a period is exact to all orders, and over half of it here
        ends = np.arange(1, most + 1) <= steps[:, None]
        harmonic = np.where(ends, 2j * np.exp(-1j * phase[:, 2::2]), 0.0) / steps[:, None]
        packed = self._packed(asked.numbers, thetas, asked.moduli)

        def eight(lanes: np.ndarray, used: np.ndarray) -> np.ndarray:
            amplitude = strain[lanes].T
            given = packed.of_eight(lanes, asked.declared) | {
                "rate": wave[:, :, None] * amplitude[:, None], "table": np.zeros(WEIGHTS),
                "last": steps, "pieces": np.ones(width.shape, np.int64),
                "cycle": np.stack([np.zeros_like(steps), steps], axis=1),
                "width": width, "share": np.ones(width.shape), "period": 2.0 * np.pi / frequency,
                "jump": np.zeros(len(steps)), "flow": flows_of(None),
            }  # fmt: skip
            _, _, of_modes = self._code(0, used, given, normal=True, mirrored=True)
            stress = np.where(ends[:, :, None], of_modes[:, 1:, 3], 0.0)
            return (np.sum(harmonic[:, :, None] * stress, axis=1) / amplitude).T

        return self._by_eights(thetas, (), eight)
