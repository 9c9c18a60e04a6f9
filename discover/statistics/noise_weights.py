"""How much each run weighs in a fit beside others, by its own noise."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from discover.statistics.noise.whiteness import FEWEST_FAST, FEWEST_TESTED
from discover.statistics.residual import STRUCTURE, fast_part

_ALIKE = 2.0
"""Noises within this factor are weighed alike: of two records of one size, equal weights where one
is twice as noisy cost a quarter of the variance at most, and their ratio is not known better."""

_UNSURE = 1.5
"""Deviation of the logarithm of a noise told by n samples, times √n: that of a median of absolute
values is 1.2 for independent ones, and third differences are not independent."""

_MOST = 100.0
"""The quietest run is taken to be no quieter than this share of the loudest: below it lie the
errors of rates, gaps and temperatures, which no sample shows."""


def weights_by_noise(
    left: Sequence[Float[np.ndarray, " _"]], kinds: Sequence[str], random: bool
) -> tuple[float, ...] | None:
    """Return how much the samples of each run weigh, in inverse proportion to their noise.

    A fit that weighs all runs alike leaves in a quiet run what the noise of the loud ones did to
    its constants. Where that is more than the quiet run's own noise, it looks like something that
    the law lacks. Weights by noise give the least variance of all   [Aitken 1936, Proc. R. Soc.
    Edinburgh 55, 42]; a law that misses the runs by more than their noise they would fit to the
    quietest run alone, so they are for laws that do not.

    Parameters
    ----------
    left
        What a fit with equal weights leaves of each run, over the size of its record.
    kinds
        The kind of test of each run: runs of too few samples to tell a noise take that of others of
        their kind.
    random
        Whether it is noise. If not, only what changes from sample to sample is.

    Returns
    -------
    One number for each run, which leave the mean noise what it is; None where equal weights are as
    good, or where some run is missed by more than the noise of any.
    """
    rows = [np.asarray(row, dtype=float) for row in left]
    if len(rows) < 2 or not all(np.all(np.isfinite(row)) for row in rows):
        return None
    size = np.array([_robust_size(row) for row in rows])
    noise = size if random else np.array([fast_part(row) for row in rows])
    count = np.array([len(row) for row in rows])
    told = count >= FEWEST_TESTED
    for kind in dict.fromkeys(kinds):
        few = np.array([own == kind for own in kinds]) & ~told
        if np.any(few):
            noise[few] = _together([row for row, one in zip(rows, few, strict=True) if one])
            count[few] = np.sum(count[few])
    known = noise > 0.0
    if not np.any(known):
        return None
    noise = np.where(known, noise, np.mean(noise[known]))
    noise = np.maximum(noise, np.max(noise) / _MOST)
    unsure = np.exp(_UNSURE / np.sqrt(count))
    if np.max(noise / unsure) <= _ALIKE * np.min(noise * unsure):
        return None
    if np.any(size > np.maximum(STRUCTURE * noise, np.max(noise))):
        return None
    return tuple(float(one) for one in np.mean(noise) / noise)


def _together(rows: Sequence[Float[np.ndarray, " _"]]) -> float:
    """Return the noise of short runs of one kind, 0 if they are too few samples to tell it."""
    together = np.concatenate(rows)
    if len(together) < FEWEST_FAST:
        return 0.0
    fast = [fast_part(row) for row in rows if len(row) >= FEWEST_FAST]
    # so few differences tell little; what is left is an upper bound
    return max(_robust_size(together), *fast, 0.0)


def _robust_size(values: Float[np.ndarray, " n"]) -> float:
    """Return a standard deviation about zero that a few outliers hardly move."""
    return 1.4826 * float(np.median(np.abs(values)))
