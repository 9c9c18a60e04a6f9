"""The runs that a learner takes."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from discover.dataset.material_functions import as_compared
from discover.dataset.run import Run
from discover.errors import InputError
from discover.first_use import require_double
from discover.learners.settings import PerMode
from discover.protocols import settled


def as_runs(runs: Iterable[Run], relaxation_time: PerMode = 0.0, relaxes: bool = True) -> list[Run]:
    """Return the runs as a list, each as `as_compared` has it.

    `runs`: a data set, or runs. `relaxation_time`: of the modes, in s. `relaxes`: whether the fluid
    is known to relax: the state of a run that starts periodic is then solved for. If not, or at a
    given stress, it gets as many cycles before it as the slowest mode needs. Raises InputError if
    there is none, one is something else, a mode is too slow to be waited for, or JAX computes in
    single precision.
    """
    require_double()
    if isinstance(runs, Run):
        raise InputError(
            f"A learner takes several runs; got the single run {runs.name!r}. Put it in a list: "
            "fit([run])."
        )
    if isinstance(runs, str) or not isinstance(runs, Iterable):
        raise InputError(
            f"A learner takes a data set or a sequence of Run; got a {type(runs).__name__}. "
            "Load a folder with load_dataset."
        )
    listed = list(runs)
    if not listed:
        raise InputError("A learner needs at least one run; got none.")
    for run in listed:
        if not isinstance(run, Run):
            raise InputError(
                f"A learner takes a sequence of Run; got a {type(run).__name__}. Load a "
                "folder or make a synthetic data set."
            )
    longest = float(np.max(np.asarray(relaxation_time)))
    return [waiting(run, longest, relaxes) for run in as_compared(listed)]


def waiting(run: Run, relaxation_time: float, relaxes: bool) -> Run:
    """Return a run with the cycles before it to wait for, if its state is not solved for."""
    if relaxes and run.protocol.control == "rate":
        return run
    return replace(run, protocol=settled(run.protocol, relaxation_time))


def require_signal(runs: Sequence[Run]) -> None:
    """Refuse runs of which nothing was recorded but zeros."""
    for run in runs:
        if not np.any(run.recorded):
            raise InputError(
                f"The shear stress of the run {run.name!r} is zero throughout: it says nothing of "
                "the law. Leave the run out."
            )
