"""Runs as learners take them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import ArrayLike, Float

from discover.dataset.material_functions import as_compared
from discover.dataset.run import Run, require_later_samples
from discover.errors import InputError
from discover.first_use import require_double
from discover.forward.flow_batch import FlowBatch
from discover.protocols import settled
from discover.protocols.kinematics import STATES

_MAKE = "Load a folder with load_dataset, or make a data set of a table with from_dataframe."


def as_runs(
    runs: Iterable[Run], relaxation_time: ArrayLike = 0.0, relaxes: bool = True
) -> list[Run]:
    """Return the runs as a list, each as `as_compared` has it.

    `relaxation_time`: of the modes, in s. `relaxes`: whether the fluid is known to relax, so that a
    periodic start is solved for; otherwise, or at a given stress, cycles are put before the run.
    Raises InputError if there is no run, one is something else, a mode is too slow, or JAX computes
    in single precision.
    """
    require_double()
    if isinstance(runs, Run):
        raise InputError(
            f"A learner takes several runs; got the single run {runs.name!r}. Put it in a list: "
            "fit([run])."
        )
    if isinstance(runs, str) or not isinstance(runs, Iterable):
        raise InputError(
            f"A learner takes a data set or a sequence of Run; got a {type(runs).__name__}. {_MAKE}"
        )
    listed = list(runs)
    if not listed:
        raise InputError("A learner needs at least one run; got none.")
    for run in listed:
        if not isinstance(run, Run):
            raise InputError(
                f"A learner takes a data set or a sequence of Run; got a {type(runs).__name__} "
                f"that holds a {type(run).__name__}. {_MAKE}"
            )
    require_later_samples(listed)
    longest = float(np.max(np.asarray(relaxation_time)))
    return [waiting(run, longest, relaxes) for run in as_compared(listed)]


def waiting(run: Run, relaxation_time: float, relaxes: bool) -> Run:
    """Return a run with the cycles before it to wait for, if its state is not solved for."""
    if relaxes and run.protocol.control == "rate":
        return run
    return replace(run, protocol=settled(run.protocol, relaxation_time))


def require_signal(runs: Sequence[Run]) -> None:
    """Refuse runs whose record is zero throughout."""
    for run in runs:
        if not np.any(run.recorded):
            raise InputError(
                f"The shear stress of the run {run.name!r} is zero throughout: it says nothing of "
                "the law. Leave the run out."
            )


_STRAIN_STEP, _PHASE_STEP, _GROWTH = 0.4, 0.3, 0.1


def rough_limits(
    flows: FlowBatch, relaxation_time: Float[np.ndarray, " k"]
) -> Mapping[str, float] | None:
    """Return limits of longer steps, as `make_grid` takes them; None where the flows have none.

    Steps grow after a change of the rate up to a strain of one, and follow the fastest relaxation
    where the fine grid does, else the slowest: over steps of many relaxation times a law that
    relaxes faster than the known one diverges.
    """
    controls = {protocols.control for protocols, _ in flows.parts}
    if not controls <= {"rate", *STATES}:
        return None
    if "rate" not in controls:
        return {"strain_step": _STRAIN_STEP}
    longest = max(
        float(np.max(np.diff(grid.times, axis=1)))
        for protocols, grid in flows.parts
        if protocols.control == "rate"
    )
    times = np.asarray(relaxation_time)
    followed = float(np.min(times) if longest <= np.min(times) else np.max(times))
    return {
        "strain_step": _STRAIN_STEP,
        "phase_step": _PHASE_STEP,
        "growth": _GROWTH,
        "max_step": max(longest, followed),
    }
