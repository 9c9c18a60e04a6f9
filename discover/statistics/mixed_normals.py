"""Quantiles of normal distributions that are mixed."""

import numpy as np
from jaxtyping import Float
from scipy.special import ndtr

_HALVINGS = 40
_FARTHEST = 8.0  # standard deviations of each, within which the quantile lies


def quantile(
    mean: Float[np.ndarray, "n ..."],
    deviation: Float[np.ndarray, "n ..."],
    share: Float[np.ndarray, "n ..."],
    level: float,
) -> Float[np.ndarray, " ..."]:
    """Return a quantile of mixed normal distributions, by halving an interval that holds it.

    Parameters
    ----------
    mean, deviation
        Of each, along the first axis; deviations above zero.
    share
        Of each, adding up to one along the first axis; it may have axes of length one.
    level
        0 to 1.
    """
    low = np.min(mean - _FARTHEST * deviation, axis=0)
    high = np.max(mean + _FARTHEST * deviation, axis=0)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        below = np.sum(share * ndtr((middle - mean) / deviation), axis=0) < level
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return 0.5 * (low + high)
