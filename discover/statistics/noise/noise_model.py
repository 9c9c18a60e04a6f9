"""The noise of a fit, as its residual shows it: a size for each run, one autocorrelation."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.linalg import matmul_toeplitz, solve_toeplitz
from scipy.signal import lfilter, lfiltic
from scipy.stats import chi2

_HIGHEST_ORDER = 12
_FEWEST_FOR_OWN_VARIANCE = 30
_FEWEST_TO_CONTRADICT = 8
_CONTRADICTS = 0.01
"""Probability of a variance so far from that of all sequences, from which on it is another."""


@dataclass(frozen=True)
class NoiseModel:
    """Autoregressive noise, with one correlation for all sequences and a variance for each.

    `coefficients`: φ of e_t = Σ φ_j e_{t−j} + innovation, shape (order,); empty for white noise.
    `correlation`: of samples k apart, from k = 0, shape (longest sequence,).
    `effective_samples`: number of independent samples whose mean would be as uncertain as that of
        all sequences.
    """

    coefficients: Float[np.ndarray, " order"]
    correlation: Float[np.ndarray, " n"]
    variance: Float[np.ndarray, " sequences"]  # of each sequence, shape (sequences,)
    effective_samples: float

    def covariance_times(self, sequence: int, columns: Float[np.ndarray, "n q"]) -> np.ndarray:
        """Return the noise covariance of one sequence times columns, without forming it."""
        if self.coefficients.size == 0:
            return self.variance[sequence] * columns
        first = self.correlation[: len(columns)]
        return self.variance[sequence] * matmul_toeplitz((first, first), columns)


def noise_model(
    residuals: Sequence[Float[np.ndarray, " _"]],
    n_parameters: int = 0,
    sizes: Sequence[float] | None = None,
) -> NoiseModel:
    """Return the noise model of residuals, its order chosen by BIC.

    The autocovariance is pooled over the sequences, so that short runs share one correlation, and
    the variance where nothing says that theirs is another; the Yule–Walker equations give the
    coefficients   [Brockwell & Davis 1991, Time Series, ch. 8].

    `residuals`: one sequence for each run and observed quantity, in the order of time. Where
    sampling is uneven the correlation is one by sample, not by time. `n_parameters`: number of
    fitted parameters, which the variance allows for. `sizes`: of what is taken for noise of one
    size in each sequence: where a long run has smaller weights than a short one, its residuals are
    smaller and its noise is not. By default the residuals are.
    """
    sizes = [1.0] * len(residuals) if sizes is None else sizes
    alike = [r / size for r, size in zip(residuals, sizes, strict=True)]
    total = sum(len(r) for r in residuals)
    shrink = total / max(total - n_parameters, 1)
    highest = min(_HIGHEST_ORDER, max(min((len(r) for r in residuals), default=1) // 4, 0))
    pooled = sum(float(r @ r) for r in alike) / total
    own = [_variance(r, pooled, n_parameters) for r in alike]
    variance = np.array([v * (s**2 * shrink) for v, s in zip(own, sizes, strict=True)])
    # a few loud samples would else decide on the correlation of all
    alike = [
        r if len(r) >= _FEWEST_FOR_OWN_VARIANCE or v == pooled else r * np.sqrt(pooled / v)
        for r, v in zip(alike, own, strict=True)
    ]
    covariance = np.array(
        [
            sum(float(r[: len(r) - k] @ r[k:]) for r in alike if len(r) > k) / total
            for k in range(highest + 1)
        ]
    )
    longest = max(len(r) for r in residuals)
    coefficients = _coefficients(covariance, total)
    correlation = np.zeros(longest)
    correlation[0] = 1.0
    order = coefficients.size
    if order:
        known = covariance[: order + 1] / covariance[0]
        recursion = np.concatenate([[1.0], -coefficients])
        state = lfiltic([1.0], recursion, known[1:][::-1])
        later = lfilter([1.0], recursion, np.zeros(max(longest - order - 1, 0)), zi=state)[0]
        correlation = np.concatenate([known, later])[:longest]
    weights = np.array([_sum_of_correlations(correlation, len(r)) for r in residuals])
    effective = total**2 / max(float(np.sum(weights)), 1.0)
    return NoiseModel(coefficients, correlation, variance, float(min(effective, total)))


def _variance(values: Float[np.ndarray, " n"], pooled: float, n_parameters: int) -> float:
    """Return the variance of a sequence: its own, or if it is short and no other, that of all.

    The flow curve of a rheometer is quieter than its transients, or louder.
    """
    squares, n = float(values @ values), len(values)
    free = n - n_parameters
    if n >= _FEWEST_FOR_OWN_VARIANCE:
        return squares / n
    if free < _FEWEST_TO_CONTRADICT:
        return pooled
    low, high = chi2.ppf([0.5 * _CONTRADICTS, 1.0 - 0.5 * _CONTRADICTS], free)
    # none at all is of a run that a caller left out
    alike = squares == 0.0 or low * pooled <= squares <= high * pooled
    return pooled if alike else squares / free


def _coefficients(covariance: np.ndarray, total: int) -> np.ndarray:
    if covariance[0] <= 0.0:
        return np.zeros(0)
    best, chosen = 0.0, np.zeros(0)  # white noise: BIC measured from there
    for order in range(1, len(covariance)):
        phi = solve_toeplitz(covariance[:order], covariance[1 : order + 1])
        innovation = 1.0 - float(phi @ covariance[1 : order + 1]) / covariance[0]
        if innovation <= 0.0:
            break
        bic = total * np.log(innovation) + order * np.log(total)
        if bic < best:
            best, chosen = bic, phi
    return chosen


def _sum_of_correlations(correlation: np.ndarray, n: int) -> float:
    lags = np.arange(1, n)
    return float(n + 2.0 * np.sum((n - lags) * correlation[1:n]))
