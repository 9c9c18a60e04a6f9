"""Quantiles of values that are not equally likely."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float


def weighted_quantiles(
    values: Float[np.ndarray, "n ..."],
    weights: Float[np.ndarray, " n"],
    levels: Sequence[float],
) -> Float[np.ndarray, "levels ..."]:
    """Return quantiles along the first axis, each value standing at the middle of its weight.

    Parameters
    ----------
    values
        At least one.
    weights
        Not negative, not all zero; they need not add up to one.
    levels
        0 to 1.
    """
    order = np.argsort(values, axis=0)
    ordered = np.take_along_axis(values, order, axis=0)
    share = (weights / np.sum(weights))[order]
    middle = np.cumsum(share, axis=0) - 0.5 * share
    found = np.empty((len(levels), *values.shape[1:]))
    for at, level in enumerate(levels):
        above = np.argmax(middle >= level, axis=0)
        above = np.where(middle[-1] < level, len(values) - 1, above)[None]
        below = np.maximum(above - 1, 0)
        low, high = (np.take_along_axis(ordered, place, axis=0)[0] for place in (below, above))
        start, end = (np.take_along_axis(middle, place, axis=0)[0] for place in (below, above))
        gap = np.where(end > start, end - start, 1.0)
        found[at] = low + np.clip((level - start) / gap, 0.0, 1.0) * (high - low)
    return found
