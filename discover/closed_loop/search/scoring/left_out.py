"""Errors of runs, or of parts of them, that a fit did not see."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from discover.inference.least_squares import Fit, stepped
from discover.inference.problem import FitProblem

_MISSED = 10.0
_WORSE = 2.0
"""Squared misfit of what is kept, over that of the whole fit, from which on a step is no fit."""


def left_out_errors(problem: FitProblem, fit: Fit) -> Float[np.ndarray, " runs"]:
    """Return the relative error of each run left out of the fit; see `left_out_parts`."""
    return run_errors(left_out_parts(problem, fit), problem.weight)


def run_errors(
    parts: Sequence[tuple[Bool[np.ndarray, "runs n"], Float[np.ndarray, "runs n"]]],
    weight: Float[np.ndarray, "runs n"],
) -> Float[np.ndarray, " runs"]:
    """Return the relative error of each run, from the parts of `left_out_parts`."""
    squares = np.zeros(len(weight))
    for held, missed in parts:
        squares += np.sum(np.where(held, missed, 0.0), axis=1)
    return np.minimum(np.sqrt(squares), _MISSED)


def left_out_parts(
    problem: FitProblem, fit: Fit
) -> list[tuple[Bool[np.ndarray, "runs n"], Float[np.ndarray, "runs n"]]]:
    """Return which samples are left out together, and the squared residuals without them.

    Runs are left out one after another. Of fewer than `FEWEST_FOLDS` runs each is left out in parts
    instead, stretches of equal length: to leave out one run of three would ask for an extrapolation
    from the other two, which says little of a law, and one run alone would be all that there is. So
    does a run that is the only one of its kind of test (`FitProblem.alone`): what a flow curve says
    of fast flow, slow start-ups cannot, and nothing in them could earn its place.

    A fit without some samples is one Gauss–Newton step from the fit with them, and they are then
    predicted with the whole nonlinear model. What cannot be predicted counts as missed by far.
    """
    model, weighted = problem.model, problem.weight > 0
    folds = _folds(weighted, problem.alone)
    trials = []
    for left_out in folds:
        # rows of zeros count for nothing
        kept = weighted & ~left_out
        residual, jacobian = fit.residual * kept, fit.jacobian * kept
        trials.append(stepped(model, fit.theta, fit.free, residual, jacobian, 1e-8, problem.prior))
    with np.errstate(over="ignore", invalid="ignore"):
        squares = [residual**2 for residual in model.residuals(trials, problem.batch)]
        # what is left has to fit better without the others than with them: a step that does not is
        # too long for a first derivative, as of a constant that the data leave open
        own = fit.residual**2
        for i, left_out in enumerate(folds):
            kept = weighted & ~left_out
            cost = np.sum(squares[i][kept])
            if np.isfinite(cost) and cost > _WORSE * np.sum(own[kept]):
                squares[i] = own
    squares = [np.where(np.isfinite(missed), missed, np.inf) for missed in squares]
    return list(zip(folds, squares, strict=True))


def part_errors(
    parts: Sequence[tuple[Bool[np.ndarray, "runs n"], Float[np.ndarray, "runs n"]]],
    weight: Float[np.ndarray, "runs n"],
) -> Float[np.ndarray, " parts"]:
    """Return the relative error of each part, from squared weighted residuals."""
    samples = np.count_nonzero(np.asarray(weight) > 0, axis=1)
    shares = [
        float(np.sum(np.sum(np.where(held, squares, 0.0), axis=1) * samples)) / held.sum()
        for held, squares in parts
    ]
    return np.minimum(np.sqrt(shares), _MISSED)


FEWEST_FOLDS = 4
"""Runs from which on each is left out as a whole."""

_PARTS = 8


def _folds(
    weighted: Bool[np.ndarray, "runs n"], alone: Sequence[int]
) -> list[Bool[np.ndarray, "runs n"]]:
    """Return which samples are left out together."""
    n_runs = len(weighted)
    parts = 1 if n_runs >= FEWEST_FOLDS else -(-_PARTS // n_runs)
    folds = []
    for run, seen in enumerate(weighted):
        own = _PARTS if run in alone and parts == 1 else parts
        for part in np.array_split(np.flatnonzero(seen), own):
            if part.size:
                left_out = np.zeros_like(weighted)
                left_out[run, part] = True
                folds.append(left_out)
    return folds
