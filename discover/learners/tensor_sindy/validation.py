"""Misfit of every member of a path on runs that its refit did not see."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from discover.dataset.run import Run
from discover.learners.tensor_sindy.refit import SCREENING, Fit, refit, sum_of_squares
from discover.learners.trajectories.problem import TrajectoryProblem


def groups_of(runs: Sequence[Run]) -> Int[np.ndarray, " runs"]:
    """Return the number of the experiment of each run: what was recorded of one goes together."""
    named = len({run.name for run in runs}) == len(runs)
    sources = [run.source if named else i for i, run in enumerate(runs)]
    order = {source: i for i, source in enumerate(dict.fromkeys(sources))}
    return np.array([order[source] for source in sources])


def run_folds(n_runs: int, n_folds: int, random_state: int | None) -> Int[np.ndarray, " runs"]:
    """Return the fold of each run, dealt out evenly in a seeded random order."""
    order = np.random.default_rng(random_state).permutation(n_runs)
    folds = np.empty(n_runs, dtype=int)
    folds[order] = np.arange(n_runs) % max(1, min(n_folds, n_runs))
    return folds


def held_out_misfits(
    problem: TrajectoryProblem,
    path: Sequence[Fit],
    folds: Int[np.ndarray, " runs"],
    scale: Float[np.ndarray, " n"],
    slots: int,
) -> tuple[Float[np.ndarray, "path folds"], Float[np.ndarray, "path runs"]]:
    """Return the relative misfit of each member on each fold and run, refitted on other folds."""
    n_folds = int(np.max(folds)) + 1
    n_terms = len(problem.library)
    samples = problem.records.recorded.shape[1]
    pairs = [(member, fold) for member in range(len(path)) for fold in range(n_folds)]
    fits = refit(
        problem,
        [path[member].support for member, _ in pairs],
        [(path[member].dense(n_terms), path[member].inner) for member, _ in pairs],
        scale,
        slots,
        [np.repeat((folds != fold)[:, None], samples, axis=1) for _, fold in pairs],
        tolerance=SCREENING**2,
    )
    target = problem.records.weighted_record
    observed = problem.records.seen.reshape(-1)
    fold_of_row = folds[problem.records.run_of_row]
    by_fold = np.empty((len(path), n_folds))
    by_run = np.empty((len(path), len(folds)))

    def misfit(fit: Fit, rows: np.ndarray) -> float:
        squares = sum_of_squares(fit.predicted[rows] - target[rows])
        # weights carry 1/√(all observations); here the mean is over the rows asked for
        return float(np.sqrt(squares * problem.records.n_observations / max(np.sum(rows), 1)))

    for (member, fold), fit in zip(pairs, fits, strict=True):
        by_fold[member, fold] = misfit(fit, observed & (fold_of_row == fold))
        for run in np.flatnonzero(folds == fold):
            by_run[member, run] = misfit(fit, observed & (problem.records.run_of_row == run))
    return by_fold, by_run
