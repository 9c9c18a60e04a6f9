"""Runs on padded grids, so that all of them share one compilation."""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from discover.dataset import Run
from discover.protocols.kinematics import Kinematics, stack_kinematics
from discover.protocols.protocol import shear_rates
from discover.simulate.grid import make_grid, stress_grid

# An instrument effect acts within the first samples, so the first gap is divided this often
_EARLY_STEPS = 0.5 ** np.arange(6)

# Runs of more steps than this go on in steps that grow while the rate is constant: most of so long
# a run is steady. Shorter ones keep the accuracy of small steps throughout
_LONG, _GROWTH = 2000, 0.05


# Of the largest stress of a flow curve: below it the noise is no longer in proportion
_LEAST_STEADY = 1e-4


class RunBatch(eqx.Module):
    """Transients at a given rate on padded grids, with a leading axis of runs.

    Attributes
    ----------
    times
        Half-step grid: step ends and middles in turn, shape (runs, 2 s − 1), in s. Negative in
        what came before the record.
    commanded_rate
        Rate there, in 1/s.
    sample_index
        Position of the samples among step ends, shape (runs, n).
    weight
        1/(rms record · √samples) at samples, 0 at padding: the squared residuals of a run then
        sum to its squared relative error.
    recorded
        What was measured in Pa, shape (runs, n).
    clock_factor
        Shape (runs,).
    strain_before
        Total strain of the sample before each run, shape (runs,).
    kinematics
        Which flow each run is; None where all are simple shear.
    """

    times: Float[Array, "runs m"]
    commanded_rate: Float[Array, "runs m"]
    sample_index: Array
    weight: Float[Array, "runs n"]
    recorded: Float[Array, "runs n"]
    clock_factor: Float[Array, " runs"]
    strain_before: Float[Array, " runs"]
    kinematics: Kinematics | None = None

    @property
    def longest(self) -> float:
        """Time of the last sample of all, in s."""
        ends = np.take_along_axis(
            np.asarray(self.times)[:, ::2], np.asarray(self.sample_index), axis=1
        )
        return float(np.max(ends))


class SteadyBatch(eqx.Module):
    """Flow curves, padded, with a leading axis of runs: a sample is a steady state at its rate.

    Attributes
    ----------
    rate
        In 1/s, shape (runs, n).
    weight
        1/(recorded stress · √samples): of a flow curve the squared residuals sum to the mean
        squared relative deviation.
    recorded, kinematics
        As in `RunBatch`.
    """

    rate: Float[Array, "runs n"]
    weight: Float[Array, "runs n"]
    recorded: Float[Array, "runs n"]
    kinematics: Kinematics | None = None

    @property
    def longest(self) -> float:
        """Zero: a steady state knows no time."""
        return 0.0


class StressBatch(eqx.Module):
    """Runs at a given stress on padded grids, with a leading axis of runs.

    Attributes
    ----------
    times
        Step ends, shape (runs, s), in s.
    imposed
        Recorded stress there, in Pa.
    recorded
        Strain at the samples, shape (runs, n).
    sample_index, weight, clock_factor, kinematics
        As in `RunBatch`.
    """

    times: Float[Array, "runs s"]
    imposed: Float[Array, "runs s"]
    sample_index: Array
    weight: Float[Array, "runs n"]
    recorded: Float[Array, "runs n"]
    clock_factor: Float[Array, " runs"]
    kinematics: Kinematics | None = None

    @property
    def longest(self) -> float:
        """Time of the last sample of all, in s."""
        ends = np.take_along_axis(np.asarray(self.times), np.asarray(self.sample_index), axis=1)
        return float(np.max(ends))


Part = RunBatch | SteadyBatch | StressBatch
"""Runs of one control, which share one program."""


class MixedBatch(eqx.Module):
    """Runs of several controls, each of which has a program of its own.

    Attributes
    ----------
    parts
        The runs of each control.
    rows
        Which runs these are.
    weight, recorded
        Of all runs in their order, as in `RunBatch`.
    """

    parts: tuple[Part, ...]
    rows: tuple[tuple[int, ...], ...] = eqx.field(static=True)
    weight: Float[np.ndarray, "runs n"]
    recorded: Float[np.ndarray, "runs n"]

    @property
    def longest(self) -> float:
        """Time of the last sample of all, in s."""
        return max(part.longest for part in self.parts)


Batch = Part | MixedBatch


def make_batch(runs: Sequence[Run], strain_step: float = 0.25) -> Batch:
    """Return runs as a batch.

    Parameters
    ----------
    runs
        One or more runs.
    strain_step
        Largest strain of one step.
    """
    make = {
        "rate": lambda some: _transients(some, strain_step),
        "steady": _steady_states,
        "stress": lambda some: _at_given_stress(some, strain_step),
    }
    controls = list(dict.fromkeys(run.protocol.control for run in runs))
    if len(controls) == 1:
        return make[controls[0]](runs)
    rows = tuple(
        tuple(i for i, run in enumerate(runs) if run.protocol.control == control)
        for control in controls
    )
    parts = tuple(
        make[control]([runs[i] for i in some]) for control, some in zip(controls, rows, strict=True)
    )
    shape = (len(runs), max(part.recorded.shape[1] for part in parts))
    weight, recorded = np.zeros(shape), np.zeros(shape)
    for some, part in zip(rows, parts, strict=True):
        n = part.recorded.shape[1]
        weight[some, :n], recorded[some, :n] = part.weight, part.recorded
    return MixedBatch(parts, rows, weight, recorded)


def _measured(run: Run, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return weights and values of a run's samples, padded to a length."""
    size = np.full(len(run), np.sqrt(np.mean(run.recorded**2)))
    if run.protocol.control == "steady":
        # over decades of stress the noise is in proportion to it, and each decade counts
        largest = float(np.max(np.abs(run.recorded)))
        size = np.maximum(np.abs(run.recorded), _LEAST_STEADY * largest)
    scale = 1.0 / (np.where(size > 0, size, 1.0) * np.sqrt(len(run)))
    pad = (0, n - len(run))
    return np.pad(scale, pad), np.pad(run.recorded, pad)


def even(weight: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return by what values of one run are divided so that their noise has one size.

    Ones but for a flow curve, whose noise is in proportion to it.

    Parameters
    ----------
    weight
        Of its samples, without padding.
    """
    least = float(np.min(weight))
    return least / weight if np.ptp(weight) > 1e-9 * least else np.ones_like(weight)


def _steady_states(runs: Sequence[Run]) -> SteadyBatch:
    n = max(len(run) for run in runs)
    # a padded sample is one more of the last
    rates = [np.pad(run.rate, (0, n - len(run)), mode="edge") for run in runs]
    weights, recorded = zip(*(_measured(run, n) for run in runs), strict=True)
    columns = (jnp.asarray(np.stack(column)) for column in (rates, weights, recorded))
    return SteadyBatch(
        *columns, kinematics=stack_kinematics([run.protocol.kinematics for run in runs])
    )


def _at_given_stress(runs: Sequence[Run], strain_step: float) -> StressBatch:
    grids = [stress_grid(run.protocol, run.time, run.recorded, strain_step) for run in runs]
    n_steps, n_samples = max(map(len, grids)), max(len(run) for run in runs)
    rows = []
    for run, grid in zip(runs, grids, strict=True):
        index = np.searchsorted(grid, run.time)
        last = grid[-1] - grid[-2]
        padded = np.concatenate([grid, grid[-1] + last * np.arange(1, n_steps - len(grid) + 1)])
        imposed = shear_rates(run.protocol, padded)
        weight, recorded = _measured(run, n_samples)
        index = np.pad(index, (0, n_samples - len(run)), mode="edge")
        rows.append((padded, imposed, index, weight, recorded, run.clock_factor))
    columns = [jnp.asarray(np.stack(column)) for column in zip(*rows, strict=True)]
    return StressBatch(
        *columns, kinematics=stack_kinematics([run.protocol.kinematics for run in runs])
    )


def _transients(runs: Sequence[Run], strain_step: float) -> RunBatch:
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
    rows = []
    for run, (grid, index) in zip(runs, grids, strict=True):
        spacing = grid[-1] - grid[-2] if len(grid) > 1 else 1.0
        padded = np.concatenate([grid, grid[-1] + spacing * np.arange(1, n_steps - len(grid) + 1)])
        half = np.empty(2 * n_steps - 1)
        half[::2] = padded
        half[1::2] = 0.5 * (padded[1:] + padded[:-1])
        rate = shear_rates(run.protocol, half).copy()
        # beyond its last sample a run is padding: no flow, nothing to blow up; but for one step, so
        # that the slope of the rate at the last sample is the flow's own
        rate[half > grid[-1] + 1.01 * spacing] = 0.0
        weight, recorded = _measured(run, n_samples)
        rows.append(
            (
                half,
                rate,
                np.pad(index, (0, n_samples - len(run)), mode="edge"),
                weight,
                recorded,
                run.clock_factor,
                run.strain_before,
            )
        )
    columns = [jnp.asarray(np.stack(column)) for column in zip(*rows, strict=True)]
    return RunBatch(
        *columns, kinematics=stack_kinematics([run.protocol.kinematics for run in runs])
    )


def data_scales(runs: Sequence[Run]) -> dict[str, float]:
    """Return the size of the properties in which effects scale their first trials.

    Times are on the instrument's clock, but for ``run_time``, which is the material's.
    """
    gaps = [float(np.min(np.diff(run.time))) / run.clock_factor for run in runs if len(run) > 1]
    lengths = [float(run.time[-1]) / run.clock_factor for run in runs]
    strains = [
        float(np.sum(np.abs(run.rate[1:]) * np.diff(run.time)))
        + abs(float(run.rate[0])) * float(run.time[0])
        for run in runs
    ]
    material_lengths = [float(run.time[-1]) for run in runs]
    stresses = [float(np.sqrt(np.mean(run.stress**2))) for run in runs]
    rates = [float(np.max(np.abs(run.rate))) for run in runs]
    stress, gap = float(np.median(stresses)) or 1.0, float(np.median(gaps or [1.0]))
    rate, length = float(np.median(rates)) or 1.0, float(np.median(lengths)) or 1.0
    return {
        "sampling_time": gap,
        "run_time": float(np.median(material_lengths)) or 1.0,
        "strain": float(np.median(strains)) or 1.0,
        "stress": stress,
        "inverse_stress": 1.0 / stress,
        "fluidity": rate / stress,
        "viscosity": stress / rate,
        "stress_rate": stress / length,
        "inertia": stress * gap / rate,
    }
