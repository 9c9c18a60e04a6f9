"""What the error of a linear sweep excuses in records: what moduli that are off by it can change.

A pattern as small as what modes miss of their sweep may be theirs. But where they miss it by noise
alone, fits average that noise, and what is left open of the moduli is their covariance. What these
errors change in a record is known, sample by sample; another pattern is not theirs, however small:
of times shorter than its last frequency tells, a sweep says nothing.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from discover.statistics.lack_of_fit import LackOfFit, what_is_left
from discover.statistics.projection import without
from discover.statistics.reading.reading_faults import Reading, Session
from discover.statistics.residual import Expectation, fast_part

REASON = "what is left ({}) has a pattern that the error of the sweep does not excuse"
"""Of what is left, in words; its size is put in."""

ADVICE = (
    "measure the sweep to frequencies as high, and as low, as the times and rates of the runs, and "
    "at a smaller strain if no modes describe it"
)

_TOO_FAR = 1e-4
_SMALLEST = 1e-6  # of records, that computed ones are accurate to


def beyond_the_sweep(
    runs: Sequence[Reading], expectation: Expectation, pattern: float | None
) -> LackOfFit | None:
    """Return what the sweep does not excuse of what is left of runs; None where it excuses all.

    The constants of the law, and errors of the moduli of unit variance, move to where both leave
    least, noise taken for white: a kind that is correlated lets them go further. Nothing is
    excused where the errors have to be far larger than the sweep allows (probability below 1e-4).

    Parameters
    ----------
    runs
        As a law predicts them, with `shared`; without it nothing is asked.
    expectation
        What a complete law may leave.
    pattern
        Relative size of what the modes miss of the sweep and noise has not: of modes too few, which
        miss records so too. That much is excused still. None for a sweep that no number of modes
        follows, of whose moduli nothing is known: it excuses nothing.
    """
    runs = [run for run in runs if len(run.times)]
    told = 0.0 if pattern is None else pattern
    if expectation.linear_error <= told or not runs or any(_exact(run) for run in runs):
        return None
    without_sweep = replace(expectation, linear_error=told)
    records = [run.predicted - run.residual for run in runs]
    before = _left(runs, [run.residual for run in runs], records, without_sweep)
    if before is None or pattern is None:
        return before
    session = Session(runs)
    if not session.is_told or session.shared is None:
        return None
    runs = session.runs
    records = [run.predicted - run.residual for run in runs]
    sizes = [
        max(fast_part(session.residual[rows]), _SMALLEST) * np.ones(len(rows))
        for rows in session.rows
    ]
    noise = np.concatenate(sizes)
    errors = (session.shared / noise).T
    columns = (session.columns / noise).T
    residual = session.residual / noise
    design = without(columns, errors)
    asked = without(columns, residual)
    normal = design.T @ design + np.eye(errors.shape[1])
    step = np.linalg.solve(normal, design.T @ asked)
    if chi2.sf(step @ step, len(step)) <= _TOO_FAR:
        return before
    moved = without(columns, residual - errors @ step) * noise
    rows = [
        moved[part] / weight for part, weight in zip(session.rows, session.weights, strict=True)
    ]
    return _left(runs, rows, records, without_sweep)


def _exact(run: Reading) -> bool:
    return run.shared is None or not len(run.shared)


def _left(
    runs: Sequence[Reading],
    rows: Sequence[np.ndarray],
    records: Sequence[np.ndarray],
    expectation: Expectation,
) -> LackOfFit | None:
    """Return what is left where that is no noise."""
    even = [np.ones(len(run.times)) if run.even is None else run.even for run in runs]
    left = what_is_left(
        [factor * row for factor, row in zip(even, rows, strict=True)],
        [factor * row for factor, row in zip(even, records, strict=True)],
        expectation,
    )
    return left if left.verdict == "unexplained" else None
