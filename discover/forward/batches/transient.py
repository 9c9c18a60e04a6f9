"""Transients at a given rate on padded grids, so that all of them share one compilation."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import equinox as eqx
import jax
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float, Int

from discover.dataset import Run
from discover.forward.batches.rate_steps import RateSteps, rate_steps
from discover.forward.grids.grid import make_grid
from discover.programs import on_device
from discover.protocols.kinematics import Kinematics, stack_kinematics
from discover.protocols.protocol import shear_rates

# An instrument effect acts within the first samples, so the first gap is divided this often
_EARLY_STEPS = 0.5 ** np.arange(6)

# Runs of more steps than this go on in steps that grow while the rate is constant: most of so long
# a run is steady. Shorter ones keep the accuracy of small steps throughout
_LONG, _GROWTH = 2000, 0.05

# Least sizes of arrays that data sets share; of runs where they have no more steps than that
_MANY_RUNS, _SAMPLES, _STEPS = 8, 128, 256


class TransientFlows(eqx.Module):
    """Flows at a given rate in time on padded grids, with a leading axis of runs.

    `times`: half-step grid: step ends and middles in turn, shape (runs, 2 s − 1), in s. Negative in
        what came before the record.
    `strain_before`: total strain of the sample before each run, shape (runs,).
    `last_step`: position of the last sample of each run among step ends; what follows is padding.
    `steps`: steps of the rate whose instants are fitted, or were; None where there is none.
    `cycle`: positions among step ends of the last cycle before the first sample, shape (runs, 2);
        −1 where the run has no periodic start.
    """

    times: Float[Array, "runs m"]
    commanded_rate: Float[Array, "runs m"]  # rate there, in 1/s
    sample_index: Array  # position of the samples among step ends, shape (runs, n)
    clock_factor: Float[Array, " runs"]  # shape (runs,)
    strain_before: Float[Array, " runs"]
    cycle: Int[Array, "runs 2"]
    last_step: Int[Array, " runs"]
    kinematics: Kinematics | None = None  # which flow each run is; None where all are simple shear
    steps: RateSteps | None = None
    cycle_steps: int = eqx.field(static=True, default=0)  # the most steps that such a cycle has

    @property
    def longest(self) -> float:
        """Time of the last sample of all, in s."""
        ends = np.take_along_axis(
            np.asarray(self.times)[:, ::2], np.asarray(self.sample_index), axis=1
        )
        return float(np.max(ends))

    def in_shared_shape(self) -> "TransientFlows":
        """Return these runs padded to one of few shapes, so that data sets share programs.

        A run more is the last once more, and what is beyond a run's end is at rest.
        """
        times, rate = np.asarray(self.times), np.asarray(self.commanded_rate)
        samples = _rounded(self.sample_index.shape[1], _SAMPLES)
        step_ends = _rounded((times.shape[1] + 1) // 2, _STEPS)
        half_steps = 2 * step_ends - 1
        # of long runs a few more are not for nothing
        runs = _rounded(len(times), _MANY_RUNS if step_ends == _STEPS else 1)
        spacing = 0.5 * (times[:, -1:] - times[:, -3:-2])
        later = times[:, -1:] + spacing * np.arange(1, half_steps - times.shape[1] + 1)
        # a straight line for one step more: the slope of the rate at the last sample stays as it is
        one_more = (2.0 * rate[:, -1:] - rate[:, [-2, -3]])[:, : later.shape[1]]
        longer = replace(
            self,
            times=on_device(np.concatenate([times, later], axis=1)),
            commanded_rate=_longer(np.concatenate([rate, one_more], axis=1), half_steps),
            sample_index=_longer(self.sample_index, samples, "edge"),
            steps=self.steps and self.steps.padded(_rounded(self.steps.start.shape[1], 1)),
        )
        return jax.tree.map(lambda values: _more_runs(values, runs), longer)


def _rounded(size: int, least: int) -> int:
    """Return the next of least × 1, 1.5, 2, 3, 4, 6, ... in whole numbers."""
    while size > least:
        if size <= 3 * least // 2:
            return 3 * least // 2
        least *= 2
    return least


def _longer(values: ArrayLike, size: int, mode: Literal["constant", "edge"] = "constant") -> Array:
    beyond = size - np.shape(values)[1]
    return on_device(np.pad(np.asarray(values), ((0, 0), (0, beyond)), mode))


def _more_runs(values: ArrayLike, runs: int) -> Array:
    values = np.asarray(values)
    more = [(0, runs - len(values)), *[(0, 0)] * (values.ndim - 1)]
    return on_device(np.pad(values, more, "edge"))


def transients(runs: Sequence[Run], strain_step: float = 0.25) -> TransientFlows:
    """Return the flows of runs at a given rate."""
    grids = []
    for run in runs:
        # a window may have cut the first samples off, but not what the instrument did by then
        gap = min([run.time[0], *np.diff(run.time)] if run.time[0] > 0 else np.diff(run.time))
        early = gap * _EARLY_STEPS
        anchors = np.unique(np.concatenate([run.time, early[early < run.time[-1]]]))
        grid, _ = make_grid(run.protocol, anchors, strain_step=strain_step)
        if len(grid) > max(_LONG, 2 * len(anchors)):
            grid, _ = make_grid(run.protocol, anchors, strain_step=strain_step, growth=_GROWTH)
        grids.append((grid, np.searchsorted(grid, run.time)))
    n_steps = max(2, *(len(g) for g, _ in grids)) if len(grids) > 1 else max(2, len(grids[0][0]))
    n_samples = max(len(run) for run in runs)
    cycles = [
        np.searchsorted(grid, run.protocol.cycle) if np.ptp(run.protocol.cycle) else (-1, -1)
        for run, (grid, _) in zip(runs, grids, strict=True)
    ]
    cycle_steps = int(max(end - start for start, end in cycles))
    if cycle_steps:
        n_steps = max(n_steps, *(int(start) + cycle_steps + 1 for start, _ in cycles))
    rows = []
    for run, cycle, (grid, index) in zip(runs, cycles, grids, strict=True):
        spacing = grid[-1] - grid[-2] if len(grid) > 1 else 1.0
        padded = np.concatenate([grid, grid[-1] + spacing * np.arange(1, n_steps - len(grid) + 1)])
        half = np.empty(2 * n_steps - 1)
        half[::2] = padded
        half[1::2] = 0.5 * (padded[1:] + padded[:-1])
        rate = shear_rates(run.protocol, half).copy()
        # beyond its last sample a run is padding: no flow, nothing to blow up; but for one step, so
        # that the slope of the rate at the last sample is the flow's own
        rate[half > grid[-1] + 1.01 * spacing] = 0.0
        rows.append(
            (
                half,
                rate,
                np.pad(index, (0, n_samples - len(run)), mode="edge"),
                run.clock_factor,
                run.strain_before,
                np.asarray(cycle),
                np.asarray(len(grid) - 1),
            )
        )
    columns = [on_device(np.stack(column)) for column in zip(*rows, strict=True)]
    return TransientFlows(
        *columns,
        kinematics=stack_kinematics([run.protocol.kinematics for run in runs]),
        steps=rate_steps(runs),
        cycle_steps=cycle_steps,
    )
