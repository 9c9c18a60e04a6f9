"""Test of equal autocorrelation of runs: a misfit depends on the flow, noise does not."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy.stats import chi2

from discover.statistics.noise.noise_model import Rows
from discover.statistics.noise.smooth_misfit import exceeded, redrawn
from discover.statistics.noise.whiteness import FEWEST_TESTED

_CORRELATIONS = np.linspace(0.0, 0.95, 39)
_PLAIN = 0.05  # probability above which nothing needs to be drawn


def same_correlation_probability(rows: Rows, intervals: Sequence[float]) -> float:
    """Return the probability of correlations that differ so much between runs, if all are one.

    Likelihood ratio of first-order noise with one correlation, from sample to sample or over time,
    ρ^(interval), whichever suits better [Wilks 1938, Ann. Math. Stat. 9, 60]; where it may be
    small, by the wild bootstrap (signs drawn with a fixed seed) on the innovations [Liu 1988, Ann.
    Stat. 16, 1696] with a gamma distribution. `rows`: residuals of each run. `intervals`: sampling
    intervals; not a number leaves a run out, as fewer than 24 samples do.
    """
    told = [
        (np.asarray(row, dtype=float), float(interval))
        for row, interval in zip(rows, intervals, strict=True)
        if np.isfinite(interval) and len(row) >= FEWEST_TESTED and np.any(row)
    ]
    if len(told) < 2:
        return 1.0
    each = [row[None] for row, _ in told]
    powers = np.array([interval for _, interval in told])
    powers = powers / np.exp(np.mean(np.log(powers)))
    probability = 1.0
    for exponents in (np.ones(len(told)), powers):
        ratio, common = _ratio(each, exponents)
        own = float(chi2.sf(ratio[0], len(told) - 1))
        if own <= _PLAIN:
            drawn = redrawn([row for row, _ in told], common[0] ** exponents)
            own = exceeded(ratio[0], _ratio(drawn, exponents)[0])
        probability = own if exponents is not powers else max(probability, own)
    return probability


def _ratio(
    stacks: Sequence[Float[np.ndarray, "draws _"]], exponents: Float[np.ndarray, " runs"]
) -> tuple[np.ndarray, np.ndarray]:
    """Return twice the log likelihood ratio of each draw, and the one correlation."""
    apart, together = 0.0, 0.0
    for rows, exponent in zip(stacks, exponents, strict=True):
        apart = apart + np.max(_likelihood(rows, _CORRELATIONS), axis=1)
        together = together + _likelihood(rows, _CORRELATIONS**exponent)
    together = np.asarray(together)
    best = np.argmax(together, axis=1)
    ratio = 2.0 * (apart - np.take_along_axis(together, best[:, None], axis=1)[:, 0])
    return np.maximum(ratio, 0.0), _CORRELATIONS[best]


def _likelihood(
    rows: Float[np.ndarray, "draws n"], rho: Float[np.ndarray, " q"]
) -> Float[np.ndarray, "draws q"]:
    """Return the logarithm of the likelihood of each row under each correlation, its size fitted.

    Σ (r_t − ρ r_{t−1})² + (1 − ρ²) r_0² of three sums.
    """
    n = rows.shape[1]
    inside = np.sum(rows[:, 1:-1] ** 2, axis=1)
    ends = rows[:, 0] ** 2 + rows[:, -1] ** 2
    product = np.sum(rows[:, 1:] * rows[:, :-1], axis=1)
    squares = (ends + inside)[:, None] - 2.0 * rho * product[:, None] + rho**2 * inside[:, None]
    return -0.5 * n * np.log(np.maximum(squares, 1e-300) / n) + 0.5 * np.log(1.0 - rho**2)
