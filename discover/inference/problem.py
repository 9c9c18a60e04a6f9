"""A model with all candidates, the runs that it is fitted to, and what its fits are worth."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from discover.dataset import Run
from discover.forward import AugmentedModel, Batch
from discover.inference.evidence import criterion, evidence
from discover.inference.least_squares import NO_PRIOR, Fit, Prior, best_of, fit_batch
from discover.protocols.between_samples import sampling_interval
from discover.statistics import LackOfFit, lack_of_fit
from discover.statistics.residual import Expectation, judged_cost, summarise


@dataclass(frozen=True)
class FitProblem:
    """What is fitted, to what.

    Attributes
    ----------
    model
        The declared model with all candidates.
    batch
        The fitted runs.
    n_candidates
        Number of candidates, the price of choosing among which every effect must pay.
    prior
        What is known of some parameters.
    alone
        Rows of runs that are the only ones of their kind of test.
    """

    model: AugmentedModel
    batch: Batch
    n_candidates: int = 1
    prior: Prior = NO_PRIOR
    alone: tuple[int, ...] = ()

    @property
    def weight(self) -> Float[np.ndarray, "runs n"]:
        """Weights of the runs, zero at padding."""
        return np.asarray(self.batch.weight)

    def fits(
        self, starts: Sequence[np.ndarray], free: Sequence[Sequence[int]], **how: float | bool
    ) -> list[Fit]:
        """Return a fit from each start in its own free parameters; options as of `fit_batch`."""
        return fit_batch(self.model, self.batch, starts, free, prior=self.prior, **how)  # pyright: ignore

    def fit(self, start: np.ndarray, free: Sequence[int]) -> Fit:
        """Return the fit from one start."""
        return self.fits([start], [free])[0]

    def best_fit(
        self, starts: Sequence[np.ndarray], free: Sequence[int], rivals: bool = False
    ) -> Fit:
        """Return the best of the fits from several starts; one that is not usable if all are so."""
        fits = self.fits(starts, [free] * len(starts), rivals=rivals)
        return best_of(fits) or fits[0]

    def without(self, fit: Fit, *effects: str) -> tuple[np.ndarray, tuple[int, ...]]:
        """Return a fit's parameters with effects at zero, and those still free without them."""
        model = self.model
        own = [p for name in effects for p in (*model.positions(name), *model.varying(name))]
        if set(effects) & set(model.adding_modes):  # one mode is left, and nothing to vary from
            own += [p for name in model.declared.by_mode for p in model.varying(name)]
        theta = fit.theta.copy()
        theta[own] = model.zero()[own]
        return theta, tuple(p for p in fit.free if p not in own)

    def at(self, theta: np.ndarray, free: Sequence[int]) -> Fit:
        """Return what parameters leave as they are, and its derivatives in the free ones."""
        found = self.model.linearise(theta, self.batch, free)
        return Fit(theta, tuple(free), found.residual, found.jacobian)

    def independent_samples(self, fit: Fit) -> float:
        """Return how many independent samples what a fit leaves is worth."""
        return summarise(fit.residual, self.weight).effective_samples

    def cost(self, fit: Fit) -> float:
        """Return the sum over the runs that judge of the squared relative errors."""
        return judged_cost(fit.residual, self.weight)

    def lack_of_fit(self, fit: Fit, runs: Sequence[Run], expectation: Expectation) -> LackOfFit:
        """Return whether what a fit leaves of the runs is noise.

        Parameters
        ----------
        fit
            The fit.
        runs
            Those of the batch, in its order.
        expectation
            What a complete law may leave.
        """
        rows = zip(fit.residual, self.weight, strict=True)
        residuals = [row[weight > 0] / weight[weight > 0] for row, weight in rows]
        even = [1.0 / run.sizes(run.recorded) for run in runs]
        intervals = [sampling_interval(run.time, run.protocol, run.quantity) for run in runs]
        records = [run.recorded for run in runs]
        return lack_of_fit(residuals, records, expectation, None, even, intervals)

    def evidence(self, before: Fit, after: Fit, effective: float, n_effects: int = 1) -> float:
        """Return the evidence for what one fit has more than another; see `evidence`."""
        return evidence(before, after, self.weight, effective, self.n_candidates, n_effects)

    def criterion(
        self, cost: float, free: Sequence[int], effects: Sequence[str], effective: float
    ) -> float:
        """Return the information criterion of a fit with some effects; see `criterion`."""
        return criterion(cost, len(free), len(effects), effective, self.n_candidates)

    def worth(self, fit: Fit, effects: Sequence[str], effective: float) -> float:
        """Return the criterion of a fit by what it leaves; see `criterion`."""
        return self.criterion(self.cost(fit), fit.free, effects, effective)
