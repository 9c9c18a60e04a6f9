"""Sizes of sequences, samples that count, how often a value is read; first-order sequences."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike
from scipy.linalg import get_lapack_funcs

Rows = Float[np.ndarray, "runs n"] | Sequence[Float[np.ndarray, " _"]]
"""One sequence for each run."""

HALF_BAND = 1.96
"""Standard deviations of half of a 95 % band."""


def root_of(covariance: Float[np.ndarray, "p p"]) -> Float[np.ndarray, "p p"]:
    """Return R with RRᵀ a covariance: its columns are independent, each a standard deviation."""
    values, vectors = np.linalg.eigh(covariance)
    return vectors * np.sqrt(np.clip(values, 0.0, None))


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
_ONE_STEP = 1e-6  # by which jumps of one step differ, over it


def hold_length(record: Float[np.ndarray, " n"]) -> int:
    """Return the hold length of a record: how often each value is read; 1 if new or by chance.

    And of what rises evenly in the steps of a converter, which repeats values too.
    """
    at = np.flatnonzero(np.diff(record))
    lengths, jumps = np.diff(at), np.abs(np.diff(record)[at])
    if len(lengths) < _FEWEST or np.ptp(jumps) < _ONE_STEP * np.max(jumps):
        return 1
    often = int(np.median(lengths))
    return often if np.mean(lengths == often) > _ALIKE else 1


def first_order(
    kept: Float[np.ndarray, " n"], gained: Float[np.ndarray, "n ..."]
) -> Float[np.ndarray, "n ..."]:
    """Return sequences of which each value is a share of the one before, and what was gained.

    `kept`: the shares, the first of nothing. `gained`: of one sequence, or a column of each.
    """
    # each value less what is kept of the one before: two diagonals
    bands = np.stack([np.ones(len(kept)), -np.append(kept[1:], 0.0)])
    (solve,) = get_lapack_funcs(("tbtrs",), (bands,))
    found, _ = solve(bands, gained.reshape(len(kept), -1), uplo="L")
    return found.reshape(gained.shape)


def rms(values: ArrayLike) -> float:
    """Return the root of the mean of the squares."""
    return float(np.sqrt(np.mean(np.square(values))))


def squared_mahalanobis_distance(
    difference: Float[np.ndarray, " n"], factor: Float[np.ndarray, "k n"]
) -> float:
    """Return dᵀ (I + FᵀF)⁻¹ d by singular values, which bear draws that nearly diverge."""
    _, sizes, rows = np.linalg.svd(factor, full_matrices=False)
    along = rows @ difference
    beside = difference - along @ rows
    return float(beside @ beside + np.sum((along / np.hypot(1.0, sizes)) ** 2))
