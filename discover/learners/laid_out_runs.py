"""Runs and their grids, with what was recorded in them, as learners take them."""

from collections.abc import Sequence
from typing import Any

import jax
import numpy as np

from discover.dataset.run import Run
from discover.errors import InputError
from discover.forward import OBSERVED, Records, make_records
from discover.forward.batches.records import Mean
from discover.forward.enough_steps import in_enough_steps
from discover.forward.grids.flow_batch import FlowBatch, lay_out
from discover.laws.multimode import Fluid
from discover.programs import on_device


def laid_out(
    runs: Sequence[Run],
    known: Fluid,
    use_normal_stresses: bool = False,
    mean: Mean = "values",
    samples_in: int = 1,
    steps_in: int = 1,
    **limits: Any,
) -> tuple[FlowBatch, Records]:
    """Return runs and their grids, and what was recorded in them of three kinds.

    Parameters
    ----------
    runs
        As `as_runs` returns them.
    known
        The known part, whose steps the grids follow.
    use_normal_stresses
        Whether N1 and N2, where measured, are looked at too.
    mean
        Whether each run counts alike, or each value.
    samples_in, steps_in
        Samples and steps are rounded up to multiples, so that different runs share a compilation.
    **limits
        Of steps, as `make_grids` takes them.

    Raises
    ------
    InputError
        If what was recorded in a run is zero throughout.
    """
    for run in runs:
        if not np.any(run.recorded):
            raise InputError(
                f"The shear stress of the run {run.name!r} is zero throughout: it says nothing of "
                "the law. Leave the run out."
            )
    n = -(-max(map(len, runs)) // samples_in) * samples_in
    flows = lay_out(
        [run.protocol for run in runs],
        [run.time for run in runs],
        n,
        relaxation_time=known.settling_time,
        **limits,
    )
    records = make_records(runs, n, mean, len(OBSERVED) if use_normal_stresses else 1)
    return (
        in_enough_steps(known, flows.with_steps_in(steps_in)),
        jax.tree.map(on_device, records),
    )
