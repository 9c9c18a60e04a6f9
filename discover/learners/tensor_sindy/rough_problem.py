"""A rougher copy of a problem, on which many supports are ranked before a few are fitted exactly.

A misfit of a per cent ranks laws as well on sixty samples of a run, and in steps that err by a
thousandth of the stress, as it does on all of them.
"""

from collections.abc import Callable, Sequence

import numpy as np

from discover.dataset.run import Run
from discover.dataset.thinning import thin_run
from discover.learners.trajectories.problem import TrajectoryProblem
from discover.protocols.kinematics import FOLLOWED

AFFORDABLE = 6000.0
"""Modes times steps of all runs up to which every support is fitted on the fine grid."""

SAMPLES = 60
"""Most samples of a run on the rough grid."""

_STRAIN_STEP, _PHASE_STEP, _GROWTH = 0.4, 0.3, 0.1
_WORTH_IT = 0.5
"""Share of the steps that a rough grid may have at most: it has programs of its own to compile."""


def rough_problem(
    problem: TrajectoryProblem,
    runs: Sequence[Run],
    make: Callable[..., TrajectoryProblem],
) -> TrajectoryProblem | None:
    """Return the problem with fewer samples and longer steps; None where that saves little.

    Steps grow after a change of the rate, up to a strain of one. Where the fine grid follows the
    fastest relaxation, and else where it follows the slowest, so does the rough one: in steps of
    many relaxation times a law that relaxes faster than the known one runs away.

    Parameters
    ----------
    problem
        On the fine grid.
    runs
        What it was made of.
    make
        Returns the problem of runs, given limits of steps as `make_grid` takes them.
    """
    controls = {protocols.control for protocols, _ in problem.flows.parts}
    steps = problem.flows.n_steps
    if problem.modulus.size * steps <= AFFORDABLE or not controls <= set(FOLLOWED):
        return None
    longest = max(float(np.max(np.diff(grid.times, axis=1))) for _, grid in problem.flows.parts)
    times = np.asarray(problem.relaxation_time)
    followed = float(np.min(times) if longest <= np.min(times) else np.max(times))
    rough = make(
        [thin_run(run, SAMPLES) for run in runs],
        strain_step=_STRAIN_STEP,
        phase_step=_PHASE_STEP,
        growth=_GROWTH,
        max_step=max(longest, followed),
    )
    return rough if rough.flows.n_steps <= _WORTH_IT * steps else None
