"""A rougher copy of a problem, to rank many supports before a few are fitted exactly."""

from collections.abc import Callable, Sequence

import numpy as np

from discover.dataset.records.thinning import thin_run
from discover.dataset.run import Run
from discover.learners.rough_grid import AFFORDABLE, WORTH_IT, rough_limits
from discover.learners.trajectories.problem import TrajectoryProblem
from discover.protocols.kinematics import STATES

SAMPLES = 60
"""Most samples of a run on the rough grid."""

_STATES_KEPT = 16
"""The same of steady and periodic states, each of which costs many steps."""


def rough_problem(
    problem: TrajectoryProblem,
    runs: Sequence[Run],
    make: Callable[..., TrajectoryProblem],
) -> TrajectoryProblem | None:
    """Return the problem with fewer samples and longer steps; None where that saves little."""
    steps = problem.flows.n_steps
    if problem.modulus.size * steps <= AFFORDABLE:
        return None
    limits = rough_limits(problem.flows, np.asarray(problem.relaxation_time))
    if limits is None:
        return None
    rough = make([enough_to_rank(run) for run in runs], **limits)
    return rough if rough.flows.n_steps <= WORTH_IT * steps else None


def enough_to_rank(run: Run) -> Run:
    """Return a run with as many of its samples as ranking laws takes."""
    return thin_run(run, _STATES_KEPT if run.protocol.control in STATES else SAMPLES)


def ranked_in_words(fine: TrajectoryProblem, rough: TrajectoryProblem | None, fitted: int) -> str:
    """Return what was left out of a search to save time; empty if nothing."""
    if rough is None:
        return ""
    share = fine.flows.n_steps / rough.flows.n_steps
    states = any(protocols.control in STATES for protocols, _ in fine.flows.parts)
    fewer = f" ({_STATES_KEPT} of a sweep or flow curve)" if states else ""
    return (
        f", {fitted} of them on all samples: to save time the others were ranked on at most "
        f"{SAMPLES} samples of a run{fewer}, in {share:.2g} times fewer steps "
        "(recipe 'thorough' fits all on all)"
    )
