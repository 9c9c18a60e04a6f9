"""Whether columns describe residuals better than chance, however correlated these may be.

How correlated noise is has to be told by the same residuals, and the stronger it is the less they
tell: of noise correlated to 0.95, eighty samples are worth two. With the likeliest correlation
alone, what such noise does by itself seems to be described too often.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int
from scipy.stats import f as fisher

_CORRELATIONS = np.concatenate([np.arange(0.0, 0.9, 0.1), np.arange(0.9, 0.995, 0.01)])
_FEWEST_FOR_OWN_SIZE = 30
_REFINED = 2  # times that sizes of runs are told by what is left
_ROUNDING = 1e-14


def probability_over_correlations(
    own: Float[np.ndarray, "m k"],
    beside: Float[np.ndarray, "m q"],
    residual: Float[np.ndarray, " m"],
    rows: Sequence[Int[np.ndarray, " _"]],
) -> float:
    """Return how probable it is that noise is described by columns as well as this is.

    Fisher's test of generalised least squares under each first-order correlation from 0 to 0.99,
    the same in all runs, averaged over what the restricted likelihood says of the correlation
    [Patterson & Thompson 1971, Biometrika 58, 545, for that; Meng 1994, Ann. Stat. 22, 1142, for
    probabilities averaged over what is not known].

    Parameters
    ----------
    own
        What is asked, each column independent of the others and of those beside.
    beside
        What is fitted along.
    residual
        Of which both are asked.
    rows
        Of each run, in the order of time; the size of noise may differ from run to run.
    """
    beside = np.linalg.svd(_of_length_one(beside), full_matrices=False)[0]
    columns = np.column_stack([beside, _of_length_one(own), residual[:, None]])
    known, asked = beside.shape[1], own.shape[1]
    free = len(residual) - known - asked
    if free < 1:
        return 1.0
    products = np.stack([_products(columns[run]) for run in rows])
    likelihoods, chances = [], []
    for correlation in _CORRELATIONS:
        parts = np.array([1.0, -correlation, correlation**2])
        steps = np.einsum("i,rijk->rjk", parts, products)
        sizes = np.ones(len(rows))
        for _ in range(_REFINED):
            sizes = _sizes(steps, sizes, rows)
        total = np.einsum("r,rjk->jk", 1.0 / sizes, steps)
        alone, both = _left(total, known), _left(total, known + asked)
        if not both > _ROUNDING * total[-1, -1]:
            return 0.0
        gain = max(alone - both, 0.0) / asked
        chances.append(fisher.sf(gain / (both / free), asked, free))
        volume = np.linalg.slogdet(total[:-1, :-1])[1]
        volume += sum(len(run) * np.log(size) for run, size in zip(rows, sizes, strict=True))
        volume -= len(rows) * np.log1p(-(correlation**2))
        likelihoods.append(-0.5 * (volume + free * np.log(both)))
    weights = np.exp(np.array(likelihoods) - max(likelihoods)) * np.gradient(_CORRELATIONS)
    return float(weights @ chances / np.sum(weights))


def _of_length_one(columns: np.ndarray) -> np.ndarray:
    norms = np.linalg.norm(columns, axis=0)
    return columns[:, norms > 0.0] / norms[norms > 0.0]


def _products(run: Float[np.ndarray, "n c"]) -> Float[np.ndarray, "3 c c"]:
    """Return of what the products under the inverse of a first-order covariance are made.

    It has three diagonals: AᵀV⁻¹A = AᵀA − ρ Σ (a_t a_{t−1}ᵀ + a_{t−1} a_tᵀ) + ρ² AᵀA without the
    ends, of innovations of unit variance.
    """
    neighbours, inner = run[1:].T @ run[:-1], run[1:-1]
    return np.stack([run.T @ run, neighbours + neighbours.T, inner.T @ inner])


def _left(total: Float[np.ndarray, "c c"], count: int) -> float:
    """Return the squares that are left of the last column by the first so many."""
    known, along = total[:count, :count], total[:count, -1]
    return float(total[-1, -1] - along @ np.linalg.lstsq(known, along, rcond=None)[0])


def _sizes(
    steps: Float[np.ndarray, "runs c c"],
    sizes: Float[np.ndarray, " runs"],
    rows: Sequence[np.ndarray],
) -> Float[np.ndarray, " runs"]:
    """Return the variance of innovations of each run over the mean; of a short one that mean."""
    total = np.einsum("r,rjk->jk", 1.0 / sizes, steps)
    fitted = np.linalg.lstsq(total[:-1, :-1], total[:-1, -1], rcond=None)[0]
    left = np.append(-fitted, 1.0)
    counts = np.array([len(run) for run in rows])
    squares = np.array([max(float(left @ run @ left), 0.0) for run in steps])
    mean = float(np.sum(squares) / np.sum(counts)) or 1.0
    found = np.where(counts >= _FEWEST_FOR_OWN_SIZE, squares / counts / mean, 1.0)
    return np.maximum(found, _ROUNDING)
