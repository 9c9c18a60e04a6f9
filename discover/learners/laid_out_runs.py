"""Runs and their grids, with what was recorded in them, as learners take them."""

from collections.abc import Sequence
from typing import Any

import jax

from discover.dataset.run import Run
from discover.forward import Records, make_records
from discover.forward.batches.records import Mean
from discover.forward.enough_steps import in_enough_steps
from discover.forward.grids.flow_batch import FlowBatch, lay_out
from discover.laws.multimode import Fluid
from discover.programs import on_device


def laid_out(
    runs: Sequence[Run], known: Fluid, mean: Mean = "values", **limits: Any
) -> tuple[FlowBatch, Records]:
    """Return runs and their grids, and what was recorded in them.

    `runs`: as `as_runs` returns them. `known`: the known part, whose steps the grids follow.
    `mean`: whether each run counts alike, or each value. `**limits`: of steps, as `make_grids`
    takes them.
    """
    n = max(map(len, runs))
    flows = lay_out(
        [run.protocol for run in runs],
        [run.time for run in runs],
        n,
        relaxation_time=known.settling_time,
        **limits,
    )
    records = make_records(runs, n, mean, 1)
    return in_enough_steps(known, flows), jax.tree.map(on_device, records)
