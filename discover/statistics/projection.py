"""Sizes of residuals, and what is left of them once other columns have taken what they can."""

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

_ROUNDING = 1e-9  # of the largest singular value, columns made of length one


def rms(values: ArrayLike) -> float:
    """Return the root of the mean of the squares."""
    return float(np.sqrt(np.mean(np.square(values))))


def without(columns: Float[np.ndarray, "m q"], values: np.ndarray) -> np.ndarray:
    """Return what the columns cannot describe of values, shape (m,) or (m, k)."""
    norms = np.linalg.norm(columns, axis=0)
    kept = columns[:, norms > 0.0] / norms[norms > 0.0]
    if not kept.shape[1]:
        return values
    return values - kept @ np.linalg.lstsq(kept, values, rcond=_ROUNDING)[0]


def squared_distance(
    difference: Float[np.ndarray, " n"], factor: Float[np.ndarray, "k n"]
) -> float:
    """Return dᵀ (I + FᵀF)⁻¹ d without the n × n matrix.

    By singular values: draws that nearly run away spread so far that the k × k matrix of Woodbury's
    identity is singular to rounding.
    """
    _, sizes, rows = np.linalg.svd(factor, full_matrices=False)
    along = rows @ difference
    beside = difference - along @ rows
    return float(beside @ beside + np.sum((along / np.hypot(1.0, sizes)) ** 2))
