"""Runs at a given stress on padded grids: creep, recovery, oscillation of the stress."""

from collections.abc import Sequence

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float

from discover.dataset import Run
from discover.forward.grids.stress_grid import stress_grid
from discover.programs import on_device
from discover.protocols.kinematics import Kinematics, stack_kinematics
from discover.protocols.protocol import shear_rates


class StressFlows(eqx.Module):
    """Runs at a given stress on padded grids, with a leading axis of runs.

    `sample_index`, `clock_factor`, `kinematics`: as in `TransientFlows`.
    """

    times: Float[Array, "runs s"]  # step ends, shape (runs, s), in s
    imposed: Float[Array, "runs s"]  # recorded stress there, in Pa
    sample_index: Array
    clock_factor: Float[Array, " runs"]
    kinematics: Kinematics | None = None

    @property
    def longest(self) -> float:
        """Time of the last sample of all, in s."""
        ends = np.take_along_axis(np.asarray(self.times), np.asarray(self.sample_index), axis=1)
        return float(np.max(ends))


def at_given_stress(runs: Sequence[Run], strain_step: float) -> StressFlows:
    """Return the flows of runs at a given stress."""
    grids = [stress_grid(run.protocol, run.time, strain_step) for run in runs]
    n_steps, n_samples = max(map(len, grids)), max(len(run) for run in runs)
    rows = []
    for run, grid in zip(runs, grids, strict=True):
        index = np.searchsorted(grid, run.time)
        last = grid[-1] - grid[-2]
        padded = np.concatenate([grid, grid[-1] + last * np.arange(1, n_steps - len(grid) + 1)])
        imposed = shear_rates(run.protocol, padded)
        index = np.pad(index, (0, n_samples - len(run)), mode="edge")
        rows.append((padded, imposed, index, run.clock_factor))
    columns = [on_device(np.stack(column)) for column in zip(*rows, strict=True)]
    return StressFlows(
        *columns, kinematics=stack_kinematics([run.protocol.kinematics for run in runs])
    )
