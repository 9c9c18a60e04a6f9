"""Bands of runs that were not fitted: mixtures over hypotheses, and what none of them holds."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.special import ndtr, ndtri

from discover.inference.engine.fits import Fit, Fitter
from discover.inference.engine.left_out import MOST_MISSED, of_the_next_run
from discover.inference.engine.rows import Rows

_RUNS_AWAY = 10.0
"""Times the size of the largest record, which no sound prediction of another run exceeds."""

_DRAWS = 12
"""Pairs of draws of the constants of a hypothesis."""

NEGLIGIBLE = 1e-3
"""Probability below which nothing is made of it that none of the hypotheses is all there is."""

_SEED = 20261128


@dataclass(frozen=True)
class Band:
    """A prediction of one run with its 95 % band, in Pa; all of shape (n,)."""

    middle: Float[np.ndarray, " n"]
    low: Float[np.ndarray, " n"]
    high: Float[np.ndarray, " n"]


class Predictions:
    """Normal predictions of rows that were not fitted, one for each hypothesis."""

    def __init__(self, posterior: Any, rows: Rows):
        self.posterior, self.rows = posterior, rows
        self.problem = posterior.problem
        self.fitter = Fitter(self.problem, rows)
        self._largest = _RUNS_AWAY * float(np.max(np.abs(self.problem.fitted.recorded)))

    def parts(self) -> list[tuple[float, np.ndarray, np.ndarray]]:
        """Return weight, mean and variance of the rows, of each hypothesis."""
        none, posterior = self.posterior.unexplained, self.posterior
        found = [
            ((1.0 - none) * share, *self._of_fit(fit))
            for fit, share in self._sound(posterior.fits)
            if (1.0 - none) * share > 1e-4
        ]
        found += [
            (none * share, *self._of_none(fit))
            for fit, share in self._sound(
                posterior.beside_curves(posterior.by_left_out or posterior.fits)
            )
            if none * share > NEGLIGIBLE
        ]
        return found

    def _sound(self, fits: Sequence[tuple[Fit, float]]) -> list[tuple[Fit, float]]:
        """Return hypotheses that do not run away in these rows, their weights adding up to one."""
        followed = {id(fit) for fit in self.followed([fit for fit, _ in fits])}
        sound = [(f, p) for f, p in fits if id(f) in followed]
        if not sound:  # where all that are likely run away, the likeliest that does not
            sound = [(fit, 1.0) for fit in self.followed(self.posterior.search.alive())[:1]]
        total = sum(p for _, p in sound)
        return [(f, p / total) for f, p in sound]

    def followed(self, fits: Sequence[Fit]) -> list[Fit]:
        """Return those of some fits that do not run away in these rows."""
        new = [fit for fit in fits if "ahead" not in fit.memory]
        found = self.fitter.predict([fit.theta for fit in new])
        for fit, predicted in zip(new, found, strict=True):
            with np.errstate(invalid="ignore"):
                sound = bool(np.all(np.abs(predicted) < self._largest))
            fit.memory["ahead"] = predicted if sound else None
        return [fit for fit in fits if fit.memory["ahead"] is not None]

    def _ahead(self, fit: Fit) -> Float[np.ndarray, " rows"] | None:
        """Return what the model of a fit predicts; None where it runs away."""
        self.followed([fit])
        return fit.memory["ahead"]

    def _apart(self, fit: Fit, predicted: np.ndarray) -> Float[np.ndarray, " rows"]:
        """Return the variance of what each run has of its own, as large as in the fitted ones."""
        assert fit.covariance is not None
        variances, fitted = np.diag(fit.covariance)[len(fit.priors) :], self.posterior.search.fitter
        return self.fitter.errors.apart(predicted, fit.linear, variances, fitted.errors)

    def _jacobian(self, fit: Fit, predicted: np.ndarray) -> Float[np.ndarray, "rows n"]:
        """Return derivatives of the rows, of those of the fitted runs that they share."""
        if "jacobian" in fit.memory:
            return fit.memory["jacobian"]
        ahead = self.fitter.start(fit.names, fit.theta)
        ahead.predicted = predicted
        self.fitter.linearise([ahead])
        assert ahead.jacobian is not None
        own = ahead.jacobian[:, : len(fit.priors)]
        # of what is linear, only transducers and moduli are those of the fitted runs
        linear = ahead.jacobian[:, len(fit.priors) :]
        fitted, alone = self.posterior.search.fitter.errors.of_runs, self.fitter.errors.of_runs
        shared = np.zeros((len(self.rows), len(fit.linear)))
        of_transducers = self.fitter.errors.of_transducers
        shared[:, of_transducers] = linear[:, of_transducers]
        shared[:, fitted.stop :] = linear[:, alone.stop :]
        gain = self.fitter.errors.gain(fit.linear)[:, None]
        fit.memory["jacobian"] = found = np.column_stack([own * gain, shared])
        return found

    def _of_fit(self, fit: Fit) -> tuple[np.ndarray, np.ndarray]:
        predicted = self._ahead(fit)
        assert predicted is not None
        assert fit.covariance is not None
        jacobian, apart = self._jacobian(fit, predicted), self._apart(fit, predicted)
        middle = predicted + jacobian[:, len(fit.priors) :] @ fit.linear
        variance = np.einsum("ij,jk,ik->i", jacobian, fit.covariance, jacobian) + apart
        noise = fit.noise.common * self.fitter.noise.deviation(middle, fit.noise.share)
        return middle, variance + noise**2

    def _of_none(self, fit: Fit) -> tuple[np.ndarray, np.ndarray]:
        """Return what a hypothesis says of the rows where it is not all there is.

        It misses them as it misses fitted runs that are left out in turn, by more where a run is
        faster. Constants are drawn, for to first order what is far would grow without bound.
        """
        predicted = self._ahead(fit)
        assert predicted is not None
        assert fit.covariance is not None
        lot = np.random.default_rng(_SEED).standard_normal((_DRAWS, len(fit.covariance)))
        thetas, linear = fit.drawn(np.concatenate([lot, -lot]))
        found = self.fitter.predict(thetas)
        sound = np.all(np.abs(np.nan_to_num(found, nan=np.inf)) < self._largest, axis=1)
        apart = self._apart(fit, predicted)
        errors = self.posterior.fitter_of(fit).at(self.fitter).errors
        middle = errors.as_read(predicted, fit.linear)
        pairs = zip(found[sound], linear[sound], strict=True)
        off = [errors.as_read(*pair) - middle for pair in pairs]
        spread = np.mean(np.square(off), axis=0) if off else 0.0
        noise = fit.noise.common * self.fitter.noise.deviation(middle, fit.noise.share)
        missed = self.missed(fit) * self.rows.size
        return middle, spread + apart + missed**2 + noise**2

    def missed(self, fit: Fit) -> Float[np.ndarray, " rows"]:
        """Return the deviation, over its size, by which each run may be missed."""
        missed, fastest = self.posterior.missed(fit), self.problem.fitted.fastest
        # as far as the worst of them, and in proportion to the rate beyond the fastest
        size = np.max(missed) * np.maximum(self.rows.fastest / np.max(fastest), 1.0)
        return np.minimum(of_the_next_run(len(missed)) * size, MOST_MISSED)[self.rows.run]


def quantiles(
    weights: Float[np.ndarray, " parts"],
    middle: Float[np.ndarray, "parts n"],
    variance: Float[np.ndarray, "parts n"],
    probabilities: Sequence[float],
) -> list[Float[np.ndarray, " n"]]:
    """Return quantiles of mixtures of normal distributions, by bisection."""
    weights = weights / np.sum(weights)
    spread = np.sqrt(np.maximum(variance, 1e-300))
    out = []
    for probability in probabilities:
        # between those of the distributions that are mixed, a billion times finer
        each = middle + ndtri(probability) * spread
        low, high = np.min(each, axis=0), np.max(each, axis=0)
        for _ in range(30):
            half = 0.5 * (low + high)
            below = weights @ ndtr((half - middle) / spread) < probability
            low, high = np.where(below, half, low), np.where(below, high, half)
        out.append(0.5 * (low + high))
    return out
