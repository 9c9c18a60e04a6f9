"""Where no run is held out, each run in turn judges what the others say of the constants.

A few effects together may follow a few runs by chance, down to what passes for noise, with
constants that each run would have otherwise. With a run left out, the others then predict it by
far worse than all together describe it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from discover.closed_loop.judging.held_out import unseen_rows
from discover.closed_loop.judging.judgement import Judgement
from discover.dataset import Run
from discover.dataset.records.repeats import repeated_tests
from discover.inference.least_squares import Fit
from discover.inference.problem import FitProblem
from discover.protocols.kinematics import STATES
from discover.statistics.residual import FEWEST_FAST, STRUCTURE
from discover.statistics.unseen import CARRIED
from discover.words import percent_of

_EXCUSED = 1e-3
"""Probability of constants that would have to move so far, above which they excuse a miss. How
uncertain they are is known to first order only."""


@dataclass(frozen=True)
class LeftOut:
    """A run, or one test that was repeated, and what the other runs make of it.

    Attributes
    ----------
    name
        Of the run, or of the first.
    error
        Relative error of its prediction, the constants fitted to the others alone.
    agreement
        Of constants that would have to move so far to describe it too, how probable they are.
    """

    name: str
    error: float
    agreement: float

    def is_missed(self, limit: float) -> bool:
        """Return whether it is missed by more than a limit, and by no uncertain constants."""
        return self.error > limit and self.agreement <= _EXCUSED


def judged_in_turn(
    judgement: Judgement, problem: FitProblem, fit: Fit, effects: Sequence[str], runs: Sequence[Run]
) -> Judgement:
    """Return a judgement that runs left out in turn do not refute; of runs held out, as it is.

    What was found is refuted if more than half of them are missed by clearly more than all together
    leave, and by more than the constants are uncertain: of a right law one run may be the only one
    that tells a constant.

    Parameters
    ----------
    judgement
        Of the final model.
    problem, fit, effects, runs
        What was fitted to what, the final fit, the effects found, and the fitted runs.
    """
    if judgement.structured or judgement.verdict != "effects_added" or judgement.unseen:
        return judgement
    limit = STRUCTURE * max(judgement.left.misfit, judgement.left.expected, judgement.resolution)
    left_out = leave_out_in_turn(problem, fit, runs)
    missed = [one for one in left_out if one.is_missed(limit)]
    if len(left_out) < 2 or 2 * len(missed) <= len(left_out):
        return judgement
    worst = max(missed, key=lambda one: one.error)
    error = float(np.mean([one.error for one in missed]))
    text = (
        f"{judgement.description} But with a run left out of the fit the others do not predict it: "
        f"of {len(left_out)} runs {len(missed)} are then missed by more than {percent_of(limit)}, "
        f"{worst.name} by {percent_of(worst.error)}, which no uncertain constant explains. What "
        f"was found ({', '.join(effects)}) describes these runs and is no finding."
    )
    return replace(
        judgement.refuted(text),
        carries_over=False,
        missed=max(STRUCTURE * error / limit, CARRIED),
        unseen=len(missed),
    )


def leave_out_in_turn(problem: FitProblem, fit: Fit, runs: Sequence[Run]) -> list[LeftOut]:
    """Return what the other runs make of each; repeats of one test are left out together.

    Tables of states are not left out, for their points are many flows; nor are runs too short to
    judge. Parameters as in `judged_in_turn`.
    """
    groups = _groups(runs)
    if len(groups) < 2:
        return []
    found = []
    for rows in groups:
        weight = problem.weight.copy()
        weight[rows] = 0.0
        rest = replace(problem, batch=problem.batch.weighing(weight))
        other = rest.fit(fit.theta, fit.free)
        error, agreement = _of_rows(problem, rest, other, rows) if other.usable else (np.inf, 0.0)
        # a residual is as much larger as its run weighs more
        error /= float(np.mean([runs[row].weight for row in rows]))
        found.append(LeftOut(runs[rows[0]].name, error, agreement))
    return found


def _groups(runs: Sequence[Run]) -> list[list[int]]:
    """Return the rows of the runs that are left out together."""
    first = {}
    for group in repeated_tests(list(runs)):
        first |= dict.fromkeys(group, group[0])
    groups: dict[str, list[int]] = {}
    for i, run in enumerate(runs):
        if len(run) >= FEWEST_FAST and run.protocol.control not in STATES:
            groups.setdefault(first.get(run.name, run.name), []).append(i)
    return list(groups.values())


def _of_rows(
    problem: FitProblem, rest: FitProblem, other: Fit, rows: Sequence[int]
) -> tuple[float, float]:
    """Return the error of runs by a fit to the others, and how well its constants suit them."""
    model, batch = problem.model, problem.batch
    found = model.linearise(other.theta, batch, other.free)
    left = found.residual[list(rows)]
    if not np.all(np.isfinite(left)):
        return np.inf, 0.0
    error = float(np.mean(np.sqrt(np.sum(left**2, axis=1))))
    unseen = unseen_rows((rest.batch, other), found, batch, rows)
    return error, unseen.moved()[1]
