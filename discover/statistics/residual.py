"""What a residual is made of: noise, or structure."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.stats import chi2

from discover.statistics.independent_samples import independent_samples

LAGS = 12
"""Neighbours up to which noise is tested for correlation."""

FEWEST_TESTED = 2 * LAGS
"""Samples of a run from which on that is done."""

FEWEST_FAST = 7
"""Samples of a run from which on its noise can be told by third differences."""

SIGNIFICANCE = 1e-3
"""Noise is taken for structure this often."""

_LARGEST_CORRELATION = 0.9


@dataclass(frozen=True)
class ResidualSummary:
    """Noise and structure in the residuals of some runs.

    Attributes
    ----------
    noise
        Relative noise of each run, from third differences of its residual.
    autocorrelation
        Correlation of neighbouring residuals of each run.
    effective_samples
        Number of independent samples that the residuals of all runs are worth.
    """

    noise: Float[np.ndarray, " runs"]
    autocorrelation: Float[np.ndarray, " runs"]
    effective_samples: float

    @property
    def noise_floor(self) -> float:
        """Mean over runs of the relative noise."""
        return float(np.mean(self.noise))


def summarise(
    residual: Float[np.ndarray, "runs n"], weight: Float[np.ndarray, "runs n"]
) -> ResidualSummary:
    """Return noise and structure of weighted residuals.

    For the noise see `fast_part`, for the number of samples `independent_samples`.

    Parameters
    ----------
    residual
        Weighted residuals, padded.
    weight
        Their weights, zero at padding.
    """
    noise, correlation, effective = [], [], 0.0
    for row, w in zip(residual, weight, strict=True):
        values = row[w > 0] * np.sqrt(np.count_nonzero(w))
        n = len(values)
        noise.append(fast_part(values))
        power = float(np.sum(values**2))
        rho = float(np.sum(values[1:] * values[:-1])) / power if power > 0 and n > 2 else 0.0
        rho = float(np.clip(rho, 0.0, 0.99))
        correlation.append(rho)
        effective += independent_samples(values)
    return ResidualSummary(np.array(noise), np.array(correlation), effective)


def fast_part(values: Float[np.ndarray, " n"]) -> float:
    """Return the standard deviation of what changes from sample to sample.

    From third differences, which a smooth sequence hardly has, through their median, which a few
    jumps hardly move   [Gasser, Sroka & Jennen-Steinmetz 1986, Biometrika 73, 625, for the idea].

    Parameters
    ----------
    values
        In order; of fewer than `FEWEST_FAST` nothing is said.
    """
    if len(values) < FEWEST_FAST:
        return 0.0
    # the coefficients 1, 3, 3, 1 have a sum of squares of 20
    return float(1.4826 * np.median(np.abs(np.diff(values, 3))) / np.sqrt(20.0))


def noise_floor(
    residual: Float[np.ndarray, "runs n"], weight: Float[np.ndarray, "runs n"]
) -> float:
    """Return the relative noise, mean over runs.

    Where the residual is noise, white or of first order, that is its size. Where it holds
    structure, it is the part of it that changes from sample to sample, see `summarise`; noise
    that is correlated itself is then underestimated. Runs too short to be tested are taken to be
    as noisy as the tested ones, or as what changes in them from sample to sample if that is more:
    their size is no sign of noise. Those that do not judge (`judging`) do not count.
    """
    rows = judging(weight)
    residual, weight = np.asarray(residual)[rows], np.asarray(weight)[rows]
    fast = summarise(residual, weight).noise
    if not is_noise(residual, weight):
        return float(np.mean(fast))
    sizes = np.sqrt(np.sum(residual**2, axis=1))
    samples = np.count_nonzero(weight > 0, axis=1)
    tested = samples >= FEWEST_TESTED
    if np.any(tested):
        sizes = np.where(tested, sizes, np.maximum(fast, np.mean(sizes[tested])))
    elif np.all(samples >= FEWEST_FAST):
        sizes = fast
    return float(np.mean(sizes))


def judging(weight: Float[np.ndarray, "runs n"]) -> Bool[np.ndarray, " runs"]:
    """Return which runs judge a model: those long enough to say how noisy they are.

    A run counts as much as any other, however few its samples, so that one bad sample could decide
    alone. Where no run is long enough, all judge; see `tells_noise`.
    """
    told = np.count_nonzero(np.asarray(weight) > 0, axis=1) >= FEWEST_FAST
    return told if np.any(told) else np.ones_like(told)


def tells_noise(weight: Float[np.ndarray, "runs n"]) -> bool:
    """Return whether any run is long enough to say how noisy it is."""
    return bool(np.any(np.count_nonzero(np.asarray(weight) > 0, axis=1) >= FEWEST_FAST))


def is_noise(residual: Float[np.ndarray, "runs n"], weight: Float[np.ndarray, "runs n"]) -> bool:
    """Return whether residuals may be noise, white or with a first-order correlation.

    Runs too short to be tested do not say that they are not; see `noise_probability`.
    """
    probability = noise_probability(residual, weight)
    return probability is None or probability > SIGNIFICANCE


def noise_probability(
    residual: Float[np.ndarray, "runs n"], weight: Float[np.ndarray, "runs n"]
) -> float | None:
    """Return how probable residuals as structured as these are, if they are noise.

    The noise may be white or have a first-order correlation. A portmanteau test   [Ljung & Box
    1978, Biometrika 65, 297] of what an autoregression of first order leaves, once on the
    correlations of all runs taken together, and once run by run, which finds patterns of their
    own; and a test of the sum over runs sample by sample, which finds a pattern that all share,
    since the noise of one run knows nothing of another's. The smallest probability counts three
    times, for there are three tests. None if every run is too short.

    Parameters
    ----------
    residual, weight
        As in `summarise`.
    """
    rows = [row[w > 0] for row, w in zip(residual, weight, strict=True)]
    rows = [
        row / np.sqrt(np.mean(row**2)) for row in rows if len(row) >= FEWEST_TESTED and np.any(row)
    ]
    if not rows:
        return None
    # noise of one instrument has one correlation
    together = _correlations(rows, 1)[0][0]
    rho = float(np.clip(together, 0.0, _LARGEST_CORRELATION))
    first = np.sqrt(1.0 - rho**2)
    white = [np.append(first * row[0], row[1:] - rho * row[:-1]) for row in rows]
    white = [row / np.sqrt(np.mean(row**2)) for row in white]
    shared, variance = _correlations(white, LAGS)
    pooled = chi2.sf(float(np.sum(shared**2 / variance)), LAGS - 1)
    own = 0.0
    for row in white:
        correlation, variance = _correlations([row], LAGS)
        own += float(np.sum(correlation**2 / variance))
    each = chi2.sf(own, LAGS * len(white) - 1)
    length = min(len(row) for row in white)
    common = np.sum([row[:length] for row in white], axis=0) / np.sqrt(len(white))
    # one run shares its pattern with none
    alike = chi2.sf(float(common @ common), length) if len(white) > 1 else 1.0
    return float(min(1.0, 3.0 * min(pooled, each, alike)))


STRUCTURE = 1.5
"""A residual this many times larger than noise and linear error together is not explained."""


@dataclass(frozen=True)
class Expectation:
    """What a complete model may leave of the data.

    Attributes
    ----------
    noise
        Relative noise, where it is known.
    linear_error
        Relative error of the linear data that the declared modes come from.
    """

    noise: float | None = None
    linear_error: float = 0.0

    def floor(self, residual: Float[np.ndarray, "runs n"], weight) -> float:
        """Return the relative noise, known or estimated."""
        return noise_floor(residual, weight) if self.noise is None else self.noise

    def size(self, residual: Float[np.ndarray, "runs n"], weight) -> float:
        """Return the relative error that noise and linear error together explain."""
        return float(np.hypot(self.floor(residual, weight), self.linear_error))

    def explains(self, residual: Float[np.ndarray, "runs n"], weight) -> bool:
        """Return whether noise and the error of the linear data explain a residual."""
        rows = judging(weight)
        error = float(np.mean(np.sqrt(np.sum(np.asarray(residual)[rows] ** 2, axis=1))))
        if error > STRUCTURE * self.size(residual, weight):
            return False
        # without an error of the linear data to allow for, what is left must look like noise
        judged = self.noise is not None or self.linear_error > 0.0
        return judged or is_noise(residual, weight)


def _correlations(rows: Sequence[np.ndarray], lags: int) -> tuple[np.ndarray, np.ndarray]:
    """Return correlations at lags 1, 2, … over several rows, and their variance in white noise."""
    total = sum(float(row @ row) for row in rows)
    count = sum(len(row) for row in rows)
    values = [sum(float(row[k:] @ row[:-k]) for row in rows) / total for k in range(1, lags + 1)]
    pairs = np.array([sum(len(row) - k for row in rows) for k in range(1, lags + 1)])
    return np.array(values), pairs / (count * (count + 2.0))
