"""Constants given the law that a learner found, and what their being fitted leaves of the law."""

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from discover.comparison.instrument.free_constants import FreeConstants
from discover.dataset import Run
from discover.effects import AbstractEffect
from discover.forward import AugmentedModel, Batch, data_scales
from discover.inference.fit_uncertainty import intervals, sequences_of
from discover.inference.least_squares import Fit, fit_batch
from discover.inference.modulus_errors import modulus_shifts, response
from discover.laws.expansion import law_of_terms
from discover.learners.results.result import LearnerResult
from discover.statistics import least_squares_covariance, root_of
from tensor_library.law_terms import LawTerms

_SETTLED = 0.5
"""Change of a constant, in halves of its 95 % interval, that is none: one standard deviation. The
coefficients of a law of terms are fitted with it in any case."""

_GAINED = 0.02
"""Share of the squared misfit that constants must remove to be worth another round."""

_LARGEST = 10.0
"""Coefficients of terms fitted with constants may be as large as this, or as they were found."""


@dataclass(frozen=True)
class JointFit:
    """Constants and coefficients of a law of terms, fitted together.

    Attributes
    ----------
    fit
        The fit; the constants come first among what is free.
    halves
        Half intervals of the constants.
    bounds
        Intervals of all that is fitted, by position.
    shifts
        What errors of the moduli change.
    """

    fit: Fit
    halves: Sequence[float]
    bounds: Mapping[int, tuple[float, float]]
    shifts: Float[np.ndarray, "k runs n"] | None


@dataclass(frozen=True)
class GivenLaw:
    """Constants given a law.

    Attributes
    ----------
    raw
        Their values, by name, as the forward model has them.
    gained
        Share of the squared misfit that they removed.
    joint
        What is known where coefficients were fitted with them; None where the law stayed.
    """

    raw: dict[str, float]
    gained: float
    joint: JointFit | None = None

    @property
    def bounds(self) -> Mapping[int, tuple[float, float]]:
        """Intervals of what was fitted, by position; none where the law stayed."""
        return {} if self.joint is None else self.joint.bounds

    def settled(self, before: Mapping[str, float]) -> bool:
        """Return whether they are where they were."""
        if self.joint is None:
            return self.gained < _GAINED
        moved = np.abs([self.raw[name] - before[name] for name in self.raw])
        return bool(np.all(moved <= _SETTLED * np.asarray(self.joint.halves)))


class ConstantsGivenLaw:
    """Fits the constants given a law, and says of the law what their being fitted leaves.

    Parameters
    ----------
    constants
        What is to be fitted.
    model
        The forward model of the declared law, with the terms of the library as effects.
    batch, runs
        The fitted runs.
    terms
        Terms of the library as effects of the model.
    """

    def __init__(
        self,
        constants: FreeConstants,
        model: AugmentedModel,
        batch: Batch,
        runs: Sequence[Run],
        terms: Sequence[AbstractEffect],
    ):
        self._constants, self._model = constants, model
        self._batch, self._runs = batch, runs
        self._names = {term.name for term in terms}

    def fitted(self, result: LearnerResult, raw: Mapping[str, float]) -> GivenLaw | None:
        """Return the constants given a law; None where it cannot be integrated.

        The coefficients of a sum of terms are fitted with them; other laws stay as they are.

        Parameters
        ----------
        result
            What a learner found.
        raw
            The constants with which it did.
        """
        if result.learner == "tensor_sindy" and all(t.term in self._names for t in result.terms):
            return self._with_coefficients(result, raw)
        return self._with_law_as_it_is(result, raw)

    def _with_coefficients(
        self, result: LearnerResult, raw: Mapping[str, float]
    ) -> GivenLaw | None:
        at = self._positions(result)
        start = self._constants.vector(raw)
        start[at] = [term.coefficient for term in result.terms]
        # a search has no limits, and its steps follow coefficients as large as it found
        model = _with_limits(self._model, at, np.maximum(np.abs(start[at]), _LARGEST))
        free = [*self._constants.free, *at]
        fit = self._fit(model, start, free)
        if fit is None:
            return None
        shifts = modulus_shifts(model, fit.theta, self._batch)
        open_ended = _with_limits(model, at, np.full(len(at), np.inf))
        bounds = intervals(open_ended, self._batch, fit, shifts)
        halves = [0.5 * (bounds[i][1] - bounds[i][0]) for i in self._constants.free]
        joint = JointFit(fit, halves, bounds, shifts)
        return GivenLaw(self._constants.raw(fit.theta), self._gained(model, start, fit), joint)

    def _with_law_as_it_is(
        self, result: LearnerResult, raw: Mapping[str, float]
    ) -> GivenLaw | None:
        law = replace(
            self._model.declared, law=result.law, law_name="", parameters=(), free_parameters=()
        )
        model = AugmentedModel(law, [], data_scales(self._runs))
        start = model.zero()
        start[model.free_positions] = list(raw.values())
        fit = self._fit(model, start, model.free_positions)
        if fit is None:
            return None
        values = map(float, fit.theta[model.free_positions])
        return GivenLaw(dict(zip(raw, values, strict=True)), self._gained(model, start, fit))

    def _fit(self, model: AugmentedModel, start: np.ndarray, free: Sequence[int]) -> Fit | None:
        fit = fit_batch(model, self._batch, [start], [free])[0]
        return fit if fit.usable else None

    def _gained(self, model: AugmentedModel, start: np.ndarray, fit: Fit) -> float:
        before = float(np.sum(model.residuals([start], self._batch)[0] ** 2))
        return 1.0 - fit.cost / before if before > 0.0 else 0.0

    def _positions(self, result: LearnerResult) -> list[int]:
        return [self._model.positions(term.term)[0] for term in result.terms]

    def law_with(self, result: LearnerResult, joint: JointFit) -> LearnerResult:
        """Return a sparse law with coefficients and intervals that allow for the constants."""
        terms = tuple(
            replace(
                term,
                coefficient=float(joint.fit.theta[position]),
                ci95=None if term.ci95 is None else joint.bounds[position],
            )
            for term, position in zip(result.terms, self._positions(result), strict=True)
        )
        law = law_of_terms(
            LawTerms.of(terms), result.law.linear_relaxation, getattr(result.law, "base", None)
        )
        details: dict[str, Any] = {**result.details, **self._uncertainty(joint)}
        drawn = details.get("draws") or {}
        if drawn and drawn.get("method") != "linear":
            reason = "the constants fitted along are not in the draws from its likelihood"
            details["draws"] = {**drawn, "method": "none", "reason": drawn.get("reason") or reason}
        return replace(result, terms=terms, law=law, details=details)

    def _uncertainty(self, joint: JointFit) -> dict[str, Any]:
        """Return how uncertain the coefficients are, whatever the constants, as searches say it."""
        fit, shifts, count = joint.fit, joint.shifts, len(self._constants.free)
        if len(fit.free) == count:
            return {"covariance": None, "modulus_errors": None}
        sequences, sizes = sequences_of(self._batch)
        design = fit.jacobian.reshape(len(fit.free), -1).T
        by_moduli = None
        if shifts is not None and len(shifts):
            by_moduli = shifts.reshape(len(shifts), -1).T
        covariance, _, _ = least_squares_covariance(
            design, fit.residual.ravel(), sequences, by_moduli, sizes
        )
        found: dict[str, Any] = {"covariance": covariance[count:, count:].tolist()}
        found["modulus_errors"] = None
        of_modes = self._model.declared.modulus_covariance
        if shifts is not None and by_moduli is not None and of_modes is not None:
            root = root_of(of_modes)
            off = response(fit.jacobian, shifts)[count:]
            found["modulus_errors"] = {"root": root.tolist(), "response": off.tolist()}
        return found


def _with_limits(
    model: AugmentedModel, at: Sequence[int], size: Float[np.ndarray, " q"]
) -> AugmentedModel:
    """Return a model in which some parameters may have these sizes."""
    other = copy.copy(model)
    other.low, other.high = model.low.copy(), model.high.copy()
    other.low[at], other.high[at] = -size, size
    return other
