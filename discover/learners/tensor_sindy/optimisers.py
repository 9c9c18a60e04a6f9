"""pysindy's sparse optimisers on a bare design matrix, swept from dense to empty."""

import warnings
from dataclasses import dataclass

import numpy as np
import pysindy
from jaxtyping import Float
from pysindy.optimizers import FROLS, SR3, SSR, STLSQ
from sklearn import config_context
from sklearn.base import clone

from discover.errors import InputError
from discover.words import unknown_name

OPTIMISERS = ("stlsq", "sr3", "ssr", "frols")
"""Optimisers that can be asked for by name; a pysindy optimiser may be given instead."""

_STRENGTHS = np.geomspace(1e-3, 1.0, 13)
_RIDGE = 1e-8  # columns have unit norm: enough to make collinear ones solvable, no more


@dataclass(frozen=True)
class SparseSolution:
    """Solution of a sparse linear problem; coefficients thresholded or penalised, not refitted."""

    support: tuple[int, ...]  # positions of the non-zero coefficients, increasing
    coefficients: Float[np.ndarray, " n"]


def check_optimiser(optimizer) -> None:
    """Raise InputError unless this is a known name or a pysindy optimiser."""
    if isinstance(optimizer, str):
        if optimizer.lower() not in OPTIMISERS:
            raise InputError(
                f"{unknown_name('optimizer', optimizer, OPTIMISERS)} Or pass a pysindy optimizer."
            )
    elif not isinstance(optimizer, pysindy.optimizers.BaseOptimizer):
        raise InputError(
            f"optimizer must be one of {', '.join(OPTIMISERS)} or a pysindy optimizer; got a "
            f"{type(optimizer).__name__}."
        )


def solve_sparse(
    optimizer,
    design: Float[np.ndarray, "rows n"],
    target: Float[np.ndarray, " rows"],
    max_terms: int,
) -> list[SparseSolution]:
    """Return the solutions of an optimiser from its mildest to its strictest setting.

    Columns and target are brought to unit norm, so that a threshold is the share of the signal that
    a term must carry. `optimizer`: a name of `OPTIMISERS`, or a pysindy optimiser as it is set.
    `max_terms`: largest support of interest to a forward method. Supports differ and are not empty.
    """
    check_optimiser(optimizer)
    norms = np.linalg.norm(design, axis=0)
    usable = np.flatnonzero(norms > 1e-12 * max(np.max(norms, initial=0.0), 1e-300))
    size = float(np.linalg.norm(target))
    if usable.size == 0 or size == 0.0:
        return []
    matrix, right = design[:, usable] / norms[usable], target / size
    solutions: dict[tuple[int, ...], SparseSolution] = {}
    for normalised in _sweep(optimizer, matrix, right, max_terms):
        coefficients = np.zeros(design.shape[1])
        coefficients[usable] = normalised * size / norms[usable]
        support = tuple(int(i) for i in np.flatnonzero(coefficients))
        if support and np.all(np.isfinite(coefficients)):
            solutions.setdefault(support, SparseSolution(support, coefficients))
    return list(solutions.values())


def _sweep(optimizer, matrix, right, max_terms):
    """Yield normalised coefficients."""
    n = matrix.shape[1]
    if not isinstance(optimizer, str):
        # a clone: pysindy's optimisers may change their own settings while they fit
        yield from _fitted(clone(optimizer), matrix, right, history=False)
        return
    name = optimizer.lower()
    if name == "stlsq":
        for strength in _STRENGTHS:
            yield from _fitted(
                STLSQ(threshold=strength, alpha=_RIDGE, unbias=False), matrix, right, False
            )
    elif name == "sr3":
        for strength in _STRENGTHS:
            # L0 with relaxation ν thresholds at √(2 λ ν)
            optimiser = SR3(
                reg_weight_lam=0.5 * strength**2, relax_coeff_nu=1.0, max_iter=200, unbias=False
            )
            yield from _fitted(optimiser, matrix, right, False)
    elif name == "ssr":
        yield from _fitted(SSR(alpha=_RIDGE, max_iter=n, unbias=False), matrix, right, True)
    else:
        steps = min(max_terms + 1, n)
        # FROLS orthogonalises, and stops with an error where columns depend on one another, as
        # those of twins do: the ridge as further rows makes them independent
        matrix = np.vstack([matrix, np.sqrt(_RIDGE) * np.eye(n)])
        right = np.concatenate([right, np.zeros(n)])
        yield from _fitted(FROLS(alpha=_RIDGE, max_iter=steps, unbias=False), matrix, right, True)


def _fitted(optimiser, matrix, right, history):
    # what is checked here was made here; checking thousands of small fits took a third of the time
    unchecked = config_context(assume_finite=True, skip_parameter_validation=True)
    with unchecked, warnings.catch_warnings():
        # "eliminated all coefficients" and "did not converge" are ordinary ends of a sweep
        warnings.simplefilter("ignore")
        try:
            optimiser.fit(matrix, right)
        except (ValueError, np.linalg.LinAlgError):
            return  # collinear columns at this setting; other settings and moves remain
    if history:
        for coefficients in optimiser.history_:
            yield np.asarray(coefficients, dtype=float).reshape(-1)
    else:
        yield np.asarray(optimiser.coef_, dtype=float).reshape(-1)
