"""Whether records answer to what was imposed, or are noise about a constant."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy.stats import f as fisher
from scipy.stats import t as student

from discover.statistics.noise.independent_samples import independent_samples
from discover.statistics.noise.whiteness import FEWEST_TESTED, noise_probability

CHANCE = 1e-3
"""Noise is taken for a signal this often. A signal that is claimed is searched for laws."""

_OTHER_RATE = 1.1  # flows whose rates differ by less than this factor are one flow


def holds_signal(
    measured: Sequence[Float[np.ndarray, " _"]], rates: Sequence[Float[np.ndarray, " _"]] | None
) -> bool:
    """Return whether records hold something that a law could be told from.

    They hold nothing if every one of them is noise (`noise_probability`) about its mean, and the
    means are one constant within their errors, although the rates differ: so looks a sensor that is
    dead or was never connected. Records whose rates do not differ, or are not given, hold nothing
    only if that constant is zero. What is too short to tell is taken to hold something.

    `measured`: records of all runs, in one unit. `rates`: what was imposed, at the samples.
    """
    rows = [np.asarray(row, dtype=float) for row in measured]
    if not rows or any(len(row) < FEWEST_TESTED for row in rows):
        return True
    if not any(np.ptp(row) > 0.0 for row in rows):
        return _means_differ(rows)
    longest = max(len(row) for row in rows)
    residual, weight, record = np.zeros((3, len(rows), longest))
    for i, row in enumerate(rows):
        residual[i, : len(row)] = row - np.mean(row)
        weight[i, : len(row)] = 1.0
        record[i, : len(row)] = row
    probability = noise_probability(residual, weight, record)
    if probability is not None and probability <= CHANCE:
        return True
    if _means_differ(rows):
        return True
    return not _rates_differ(rates) and _mean_is_there(rows)


def _means_differ(rows: Sequence[np.ndarray]) -> bool:
    """Return whether the means of several rows are not one   [Welch 1951, Biometrika 38, 330]."""
    means, errors, counts = _means(rows)
    if len(rows) < 2:
        return False
    if np.any(errors == 0.0):
        return bool(np.ptp(means) > 1e-9 * np.max(np.abs(means)))
    trust = 1.0 / errors**2
    middle = np.sum(trust * means) / np.sum(trust)
    k = len(rows)
    excess = float(np.sum((1.0 - trust / np.sum(trust)) ** 2 / np.maximum(counts - 1.0, 1.0)))
    spread = float(np.sum(trust * (means - middle) ** 2)) / (k - 1)
    ratio = spread / (1.0 + 2.0 * (k - 2) / (k**2 - 1) * excess)
    return bool(fisher.sf(ratio, k - 1, (k**2 - 1) / (3.0 * excess)) < CHANCE)


def _mean_is_there(rows: Sequence[np.ndarray]) -> bool:
    means, errors, counts = _means(rows)
    if np.any(errors == 0.0):
        return bool(np.any(means != 0.0))
    trust = 1.0 / errors**2
    distance = abs(float(np.sum(trust * means))) / np.sqrt(float(np.sum(trust)))
    freedom = max(float(np.sum(counts - 1.0)), 1.0)
    return bool(2.0 * student.sf(distance, freedom) < CHANCE)


def _means(rows: Sequence[np.ndarray]):
    """Return the mean of each row, its standard error, and how many samples it is worth."""
    means = np.array([np.mean(row) for row in rows])
    counts = np.array([independent_samples(row - np.mean(row)) for row in rows])
    spread = np.array([np.std(row, ddof=1) for row in rows])
    return means, spread / np.sqrt(counts), counts


def _rates_differ(rates: Sequence[np.ndarray] | None) -> bool:
    """Return whether what was imposed changes, from run to run or within one."""
    if rates is None:
        return False
    every = np.concatenate([np.ravel(rate) for rate in rates])
    low, high = float(np.min(every)), float(np.max(every))
    return high > 0.0 > low or max(abs(low), abs(high)) > _OTHER_RATE * min(abs(low), abs(high))
