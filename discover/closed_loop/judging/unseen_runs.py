"""What runs that no fit saw say of a final model."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from discover.closed_loop.judging.fitted_runs import FittedRuns
from discover.closed_loop.judging.held_out import HeldOut
from discover.closed_loop.judging.tolerated_misfit import ToleratedMisfit
from discover.closed_loop.results.run_record import RunRecord
from discover.inference.least_squares import Fit
from discover.statistics.residual import FEWEST_FAST, STRUCTURE, summarise, tells_noise
from discover.statistics.unseen import CARRIED, Unseen, refutes


@dataclass(frozen=True)
class UnseenRuns:
    """How a final model predicts runs that no fit saw.

    Attributes
    ----------
    error
        Relative error, mean over them; 0 where there are none.
    asked
        Relative error that can be asked for.
    carries_over
        Whether they are predicted as well as that, or cannot tell.
    pattern
        Whether they are, and what is left has a pattern that refutes the model all the same.
    """

    error: float
    asked: float
    carries_over: bool
    pattern: bool


def what_unseen_runs_say(
    tolerated: ToleratedMisfit,
    fitted: FittedRuns,
    fit: Fit,
    active: Sequence[str],
    records: Sequence[RunRecord],
    held: HeldOut | None,
) -> UnseenRuns:
    """Return how a final model predicts runs that no fit saw."""
    error = _error([record for record in records if record.held_out])
    asked = max(fitted.left.misfit, fitted.left.expected, fitted.resolution)
    if held is None:
        return UnseenRuns(error, asked, True, False)
    # knocks in runs that no fit saw refute no law
    unseen = held.unseen.without_outliers(tolerated.expectation)
    error = min(error, unseen.error)
    carries_over = error <= CARRIED * asked
    if not carries_over:
        # held-out runs may be noisier than the fitted ones, or rounded more coarsely
        own = summarise(held.residual, held.weight).noise
        limit = held.resolution.limit(fit.theta, active, error)
        asked = max(asked, held.resolution.mean(own), limit)
        carries_over = error <= CARRIED * asked
        # and a few samples, off by chance, decide nothing
        carries_over |= tells_noise(tolerated.weight) and not tells_noise(held.weight)
    pattern = False
    if fitted.explained and carries_over and fitted.noise_known:
        pattern = _refuted_by(tolerated, fit, unseen, fitted.like_noise)
    if pattern:
        limit = held.resolution.limit(fit.theta, active, error)
        # what arithmetic did to the fitted runs, constants carry over
        pattern = error > STRUCTURE * max(limit, fitted.resolution)
    return UnseenRuns(error, asked, carries_over and not pattern, pattern)


def _refuted_by(tolerated: ToleratedMisfit, fit: Fit, unseen: Unseen, together: bool) -> bool:
    """Return whether runs that no fit saw say that something is missing.

    The fitted ones have a voice too where noise explains them, and not arithmetic alone.
    """
    weight = tolerated.weight if together else tolerated.weight[:0]
    seen = [w > 0 for w in weight]
    rows = [r[s] / w[s] for r, w, s in zip(fit.residual, weight, seen, strict=False)]
    records = [r[s] for r, s in zip(tolerated.records, seen, strict=False)]
    return refutes(unseen, rows, records, tolerated.expectation)


def _error(records: Sequence[RunRecord]) -> float:
    """Return the mean error of the final model over the runs that judge; 0 of none."""
    told = [record for record in records if len(record.time) >= FEWEST_FAST]
    return float(np.mean([record.errors[-1] for record in told or records] or [0.0]))
