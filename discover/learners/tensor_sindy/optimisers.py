"""pysindy's sparse optimisers on a bare design matrix, swept from dense to empty."""

import warnings

import numpy as np
from jaxtyping import Float
from pysindy.optimizers import FROLS, SR3, SSR, STLSQ, BaseOptimizer
from sklearn import config_context
from sklearn.base import clone

from discover.errors import InputError
from discover.words import unknown_name

OPTIMISERS = ("stlsq", "sr3", "ssr", "frols")
"""Optimisers that can be asked for by name; a pysindy optimiser may be given instead."""

_STRENGTHS = np.geomspace(1e-3, 1.0, 13)
_RIDGE = 1e-8  # columns have unit norm: enough to make collinear ones solvable, no more


Support = tuple[int, ...]
"""Positions of the non-zero coefficients, increasing."""


def check_optimiser(optimizer) -> None:
    """Raise InputError unless this is a known name or a pysindy optimiser."""
    if isinstance(optimizer, str):
        if optimizer.lower() not in OPTIMISERS:
            raise InputError(
                f"{unknown_name('optimizer', optimizer, OPTIMISERS)} Or pass a pysindy optimizer."
            )
    elif not isinstance(optimizer, BaseOptimizer):
        raise InputError(
            f"optimizer must be one of {', '.join(OPTIMISERS)} or a pysindy optimizer; got a "
            f"{type(optimizer).__name__}."
        )


def solve_sparse(
    optimizer,
    design: Float[np.ndarray, "rows n"],
    target: Float[np.ndarray, " rows"],
    max_terms: int,
) -> dict[Support, Float[np.ndarray, " n"]]:
    """Return coefficients by support, from an optimiser's mildest to its strictest setting.

    Thresholded or penalised, not refitted. Columns and target are brought to unit norm, so that a
    threshold is the share of the signal that a term must carry. `optimizer`: a name of
    `OPTIMISERS`, or a pysindy optimiser as it is set. `max_terms`: largest support of interest to a
    forward method.
    """
    name = optimizer.lower() if isinstance(optimizer, str) else ""
    norms = np.linalg.norm(design, axis=0)
    usable = np.flatnonzero(norms > 1e-12 * max(np.max(norms, initial=0.0), 1e-300))
    size = float(np.linalg.norm(target))
    if usable.size == 0 or size == 0.0:
        return {}
    matrix, right = design[:, usable] / norms[usable], target / size
    if name == "frols":
        # it orthogonalises, and stops with an error where columns depend on one another, as those
        # of twins do: the ridge as further rows makes them independent
        matrix = np.vstack([matrix, np.sqrt(_RIDGE) * np.eye(usable.size)])
        right = np.concatenate([right, np.zeros(usable.size)])
    solutions: dict[Support, np.ndarray] = {}
    # a clone: pysindy's optimisers may change their own settings while they fit
    each = _of_name(name, usable.size, max_terms) if name else [clone(optimizer)]
    for one in each:
        for normalised in _fitted(one, matrix, right, history=name in ("ssr", "frols")):
            coefficients = np.zeros(design.shape[1])
            coefficients[usable] = normalised * size / norms[usable]
            support = tuple(np.flatnonzero(coefficients).tolist())
            if support and np.all(np.isfinite(coefficients)):
                solutions.setdefault(support, coefficients)
    return solutions


def _of_name(name: str, n: int, max_terms: int) -> list[BaseOptimizer]:
    """Return an optimiser for `n` columns at each of its settings."""
    if name == "stlsq":
        return [STLSQ(threshold=one, alpha=_RIDGE, unbias=False) for one in _STRENGTHS]
    if name == "sr3":
        # L0 with relaxation ν thresholds at √(2 λ ν)
        settings = {"relax_coeff_nu": 1.0, "max_iter": 200, "unbias": False}
        return [SR3(reg_weight_lam=0.5 * one**2, **settings) for one in _STRENGTHS]
    if name == "ssr":
        return [SSR(alpha=_RIDGE, max_iter=n, unbias=False)]
    return [FROLS(alpha=_RIDGE, max_iter=min(max_terms + 1, n), unbias=False)]


def _fitted(optimiser, matrix, right, history: bool) -> list[np.ndarray]:
    # what is checked here was made here; checking thousands of small fits took a third of the time
    unchecked = config_context(assume_finite=True, skip_parameter_validation=True)
    with unchecked, warnings.catch_warnings():
        # "eliminated all coefficients" and "did not converge" are ordinary ends of a sweep
        warnings.simplefilter("ignore")
        try:
            optimiser.fit(matrix, right)
        except (ValueError, np.linalg.LinAlgError):
            return []  # collinear columns at this setting; other settings and moves remain
    found = optimiser.history_ if history else [optimiser.coef_]
    return [np.asarray(one, dtype=float).reshape(-1) for one in found]
