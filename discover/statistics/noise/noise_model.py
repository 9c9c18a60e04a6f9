"""Noise of a fit from its residual: a size for each run, one autocorrelation."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import ArrayLike
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
    """Autoregressive noise with one correlation for all sequences and a variance for each.

    `coefficients`: φ of e_t = Σ φ_j e_{t−j} + innovation, shape (order,). `correlation`: by lag
    from 0, shape (longest sequence,). `effective_samples`: of all sequences.
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

    The autocovariance is pooled over the sequences, and the variance where nothing contradicts;
    Yule–Walker equations give the coefficients [Brockwell & Davis 1991, Time Series, ch. 8].
    `residuals`: one sequence for each run and quantity, in the order of time. `n_parameters`:
    fitted ones. `sizes`: of each sequence, in whose units noise is alike.
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
    """Return the variance of a sequence: its own, or that of all if it is short and alike."""
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


HALF_BAND = 1.96
"""Standard deviations of half of a 95 % band."""

_UNSEEN = 1e-14
"""Of the largest eigenvalue of SᵀS, its columns made of length one: below it is only rounding."""

_OPEN = 100.0
"""Standard deviation of what no sample sees, in units in which every column has length one: so far
off, either of two parameters that cancel changes the residual a hundredfold of its unit."""


def root_of(covariance: Float[np.ndarray, "p p"]) -> Float[np.ndarray, "p p"]:
    """Return R with RRᵀ a covariance: its columns are independent, each a standard deviation."""
    values, vectors = np.linalg.eigh(covariance)
    return vectors * np.sqrt(np.clip(values, 0.0, None))


def least_squares_covariance(
    columns: Float[np.ndarray, "rows p"],
    residual: Float[np.ndarray, " rows"],
    sequences: Sequence[Int[np.ndarray, " _"]],
    sizes: Sequence[float] | None = None,
) -> tuple[Float[np.ndarray, "p p"], Float[np.ndarray, "p p"], NoiseModel]:
    """Return C = (SᵀS)⁻¹ SᵀΩS (SᵀS)⁻¹, (SᵀS)⁻¹, and the noise of which Ω is made.

    Infinite where a sensitivity is not finite. What no sample sees has the pseudo-inverse, and in C
    a deviation far beyond any finding. `columns`: S. `sequences`: rows of each sequence in the
    order of time. `sizes`: as of `noise_model`.
    """
    if not (np.all(np.isfinite(columns)) and np.all(np.isfinite(residual))):
        # of a law that diverges beside its fit: nothing is known of its constants
        told = [np.nan_to_num(residual[rows], posinf=0.0, neginf=0.0) for rows in sequences]
        nothing = np.full((columns.shape[1],) * 2, np.inf)
        return nothing, nothing, noise_model(told, columns.shape[1], sizes)
    noise = noise_model([residual[rows] for rows in sequences], columns.shape[1], sizes)
    # columns of like size, or the pseudo-inverse would drop what is merely small
    norms = np.linalg.norm(columns, axis=0)
    norms = np.where(norms > 0, norms, 1.0)
    scaled = columns / norms
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    seen = values > _UNSEEN * np.max(values, initial=0.0)
    inverse = vectors[:, seen] / values[seen] @ vectors[:, seen].T
    unseen = _OPEN**2 * vectors[:, ~seen] @ vectors[:, ~seen].T
    middle = sum(
        scaled[rows].T @ noise.covariance_times(i, scaled[rows]) for i, rows in enumerate(sequences)
    )
    squares = np.outer(norms, norms)
    return (inverse @ middle @ inverse + unseen) / squares, inverse / squares, noise


def independent_samples(values: Float[np.ndarray, " n"]) -> float:
    """Return the effective sample size of a correlated sequence [Geyer 1992, Stat. Sci. 7, 473].

    n/(1 + 2 Σ ρ_k), summed to the first lag without correlation: it counts the swings of a smooth
    sequence, however densely sampled.
    """
    n = len(values)
    power = float(np.sum(values**2))
    if power == 0.0 or n < 3:
        return max(1.0, float(n))
    spectrum = np.abs(np.fft.rfft(values, 2 * n)) ** 2
    correlation = np.fft.irfft(spectrum)[:n] / power
    lost = np.flatnonzero(correlation <= 0.0)
    together = float(np.sum(correlation[1 : lost[0] if len(lost) else n]))
    return max(1.0, n / (1.0 + 2.0 * together))


_FEWEST = 10  # values, from which on their repeats are a rule
_ALIKE = 0.8  # share of them that is read equally often


def read_times(record: Float[np.ndarray, " n"]) -> int:
    """Return the hold length of a record: how often each value is read; 1 if new or by chance."""
    lengths = np.diff(np.flatnonzero(np.diff(record)))
    if len(lengths) < _FEWEST:
        return 1
    often = int(np.median(lengths))
    return often if np.mean(lengths == often) > _ALIKE else 1


def rms(values: ArrayLike) -> float:
    """Return the root of the mean of the squares."""
    return float(np.sqrt(np.mean(np.square(values))))


def squared_distance(
    difference: Float[np.ndarray, " n"], factor: Float[np.ndarray, "k n"]
) -> float:
    """Return dᵀ (I + FᵀF)⁻¹ d by singular values, which bear draws that nearly diverge."""
    _, sizes, rows = np.linalg.svd(factor, full_matrices=False)
    along = rows @ difference
    beside = difference - along @ rows
    return float(beside @ beside + np.sum((along / np.hypot(1.0, sizes)) ** 2))
