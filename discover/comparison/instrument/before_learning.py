"""Constants before any learner: fitted with the declared law alone, and with the classical ones."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from discover.comparison.instrument.free_constants import FreeConstants
from discover.dataset import Run
from discover.errors import InputError
from discover.forward import AugmentedModel, Batch, data_scales, make_batch
from discover.inference.least_squares import Fit, best_of, fit_batch
from discover.laws.textbook.maxwell import UpperConvectedMaxwell
from discover.learners.shorter_holds import with_shorter_holds
from discover.protocols import strains
from discover.protocols.kinematics import LINEAR_STRAIN
from discover.study.declared_model import MODE_CONSTANTS

CLASSICAL_EFFECTS: Mapping[str, str] = {
    "johnson_segalman": "non_affine_motion",
    "giesekus": "giesekus_mobility",
    "ptt_linear": "ptt_linear",
    "ptt_exponential": "ptt_exponential",
}
"""The classical laws as effects on a Maxwell law, which one compiled program holds."""

_FEWEST_LINEAR = 10

_TIME_STARTS = (0.1, 0.3, 1.0, 3.0, 10.0)
_LONGER_TIMES = (1.0, 10.0)
"""A law that thins may relax much more slowly than the Maxwell law that fits best, which comes near
a viscosity that falls with the rate only where it relaxes at once."""

_STRAIN_STEP = 0.1
"""Where times are fitted, the largest strain of a step. In steps of many relaxation times a law
that thins is followed wrongly, and the fit finds constants for which that looks like the record."""


class BeforeLearning:
    """What the records say of the constants with laws that are known beforehand.

    Parameters
    ----------
    constants
        What is to be fitted.
    model
        The forward model of the declared law, with the classical laws as effects.
    runs
        The fitted runs.
    """

    def __init__(self, constants: FreeConstants, model: AugmentedModel, runs: Sequence[Run]):
        self._constants, self._model, self._runs = constants, model, runs

    @cached_property
    def batch(self) -> Batch:
        """The fitted runs; where times are fitted, in short steps and with shorter holds."""
        declared, positions = self._constants.declared, self._constants.positions
        # an instrument may act by its own clock, as a drift does
        if self._constants.moves_times and not declared.effects:
            # a Maxwell law is linear, and right in steps of any length
            small = AugmentedModel(self._model.declared, [], data_scales(self._runs))
            modes = [positions[name] for name in MODE_CONSTANTS if name in positions]
            starts = [start[: len(small.zero())] for start in self._first_starts()[0]]
            alone = self._best(small, starts, [modes] * len(starts), make_batch(self._runs))
            times = declared.relaxation_time * np.exp(alone.theta[1])
            shorter = with_shorter_holds(self._runs, float(np.max(times)))
            return make_batch(shorter, strain_step=_STRAIN_STEP)
        return make_batch(self._runs)

    @cached_property
    def alone(self) -> Fit:
        """The constants fitted with the declared law alone, to all samples."""
        return self._best(self._model, *self._first_starts())

    def _first_starts(self) -> tuple[list[np.ndarray], list[list[int]]]:
        factors = _TIME_STARTS if self._constants.moves_times else (1.0,)
        zero = self._model.zero()
        starts = [self._constants.with_longer_times(zero, factor) for factor in factors]
        return starts, [self._constants.free] * len(starts)

    @cached_property
    def classical(self) -> dict[str, Fit]:
        """The classical laws with the constants fitted along, by name of the law."""
        model, fits = self._classical_model, {"ucm": self.alone}
        if model is not self._model:
            fits["ucm"] = self._best(model, [self.alone.theta], [self._constants.free])
        start = fits["ucm"].theta
        longer_times = _LONGER_TIMES if self._constants.moves_times else (1.0,)
        for law, effect in CLASSICAL_EFFECTS.items():
            at = self._model.positions(effect)
            starts = []
            for share, longer in itertools.product((1.0, 10.0), longer_times):
                theta = self._constants.with_longer_times(start, longer)
                theta[at] = np.clip(
                    share * self._model.first_trial[at], self._model.low[at], self._model.high[at]
                )
                starts.append(theta)
            best = self._best(model, starts, [[*self._constants.free, *at]] * len(starts))
            # constants that stand for one another may have come to their last step in a valley
            fits[law] = self._best(model, [best.theta], [best.free])
        return fits

    @cached_property
    def start(self) -> dict[str, float]:
        """Constants to start from: from small strains, else those of the best classical law."""
        found = self._at_small_strain()
        if found is not None:
            return self._constants.raw(found)
        best = min(self.classical.values(), key=lambda fit: fit.cost)
        return self._constants.raw(best.theta)

    def _at_small_strain(self) -> np.ndarray | None:
        """Return the parameters fitted where every fluid is linear; None with too few samples."""
        weight = np.asarray(self.batch.weight)
        kept = np.zeros_like(weight)
        for row, run in zip(kept, self._runs, strict=True):
            if run.quantity == "sigma12" and run.from_rest:
                strain = strains(run.protocol, run.time) if run.strain is None else run.strain
                small = np.maximum.accumulate(np.abs(strain)) <= LINEAR_STRAIN
                if np.count_nonzero(small) >= _FEWEST_LINEAR:
                    row[: len(run)] = small
        if np.count_nonzero(kept.any(axis=1)) < 2:
            return None
        # weights alone differ, so that the compiled program serves
        batch = self.batch.weighing(weight * kept)
        fit = fit_batch(self._model, batch, [self.alone.theta], [self._constants.free])[0]
        return fit.theta if fit.usable else None

    @cached_property
    def _classical_model(self) -> AugmentedModel:
        """The forward model in which the declared law is set aside."""
        if isinstance(self._constants.declared.law, UpperConvectedMaxwell):
            return self._model
        plain = replace(self._model.declared, law=UpperConvectedMaxwell())
        return AugmentedModel(plain, self._model.effects, data_scales(self._runs))

    def _best(
        self,
        model: AugmentedModel,
        starts: Sequence[np.ndarray],
        free: Sequence[Sequence[int]],
        batch: Batch | None = None,
    ) -> Fit:
        batch = self.batch if batch is None else batch
        fits = fit_batch(model, batch, list(starts), free, rivals=True)
        best = best_of(fits) or fits[0]
        if not best.usable:
            raise InputError(
                "The declared model cannot be integrated through the fitted runs: its stress runs "
                "away. Check its parameters, modes and units."
            )
        return best
