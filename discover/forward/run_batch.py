"""Runs on padded grids, so that all of them share one compilation."""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from discover.dataset import Run
from discover.protocols.kinematics import MODULI, Kinematics, stack_kinematics
from discover.protocols.protocol import shear_rates
from discover.simulate.grid import make_grid, stress_grid

# An instrument effect acts within the first samples, so the first gap is divided this often
_EARLY_STEPS = 0.5 ** np.arange(6)

# Runs of more steps than this go on in steps that grow while the rate is constant: most of so long
# a run is steady. Shorter ones keep the accuracy of small steps throughout
_LONG, _GROWTH = 2000, 0.05


# Of the largest value of a flow curve or sweep: below it the noise is no longer in proportion
_LEAST_STEADY = 1e-4

# Of a radian: the time in which a change of a periodic stress is seen, in its phase
_SEEN = 0.1

# Steps in half a cycle: at most this much strain in each, at least this many, and a limit that only
# a strain given in the wrong unit reaches
_FEWEST_STEPS, _MOST_STEPS = 12.0, 4000


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
    cycle
        Positions among step ends of the last cycle before the first sample, shape (runs, 2);
        −1 where the run has no periodic start.
    cycle_steps
        The most steps that such a cycle has.
    """

    times: Float[Array, "runs m"]
    commanded_rate: Float[Array, "runs m"]
    sample_index: Array
    weight: Float[Array, "runs n"]
    recorded: Float[Array, "runs n"]
    clock_factor: Float[Array, " runs"]
    strain_before: Float[Array, " runs"]
    cycle: Int[Array, "runs 2"]
    kinematics: Kinematics | None = None
    cycle_steps: int = eqx.field(static=True, default=0)

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


class OscillationBatch(eqx.Module):
    """Periodic states, padded, with a leading axis of sweeps: both moduli of each are computed.

    Attributes
    ----------
    strain, frequency
        Amplitude and rad/s, shape (sweeps, n).
    phase
        ωt at step ends and middles in turn over half a cycle, shape (sweeps, m).
    """

    strain: Float[Array, "sweeps n"]
    frequency: Float[Array, "sweeps n"]
    phase: Float[Array, "sweeps m"]

    @property
    def longest(self) -> float:
        """Zero: a periodic state knows no time since it began."""
        return 0.0


Part = RunBatch | SteadyBatch | StressBatch
"""Runs of one control, which share one program, one row for each run."""


class MixedBatch(eqx.Module):
    """Runs of several controls, each of which has a program of its own.

    Attributes
    ----------
    parts
        The runs of each control.
    rows
        Which runs these are.
    moduli
        Of each run that is a modulus, which sweep of its part, and whether G′ (0) or G″ (1).
    weight, recorded
        Of all runs in their order, as in `RunBatch`.
    """

    parts: tuple[Part | OscillationBatch, ...]
    rows: tuple[tuple[int, ...], ...] = eqx.field(static=True)
    moduli: tuple[tuple[int, int], ...] = eqx.field(static=True)
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
    if len(controls) == 1 and controls[0] in make:
        return make[controls[0]](runs)
    moduli: tuple[tuple[int, int], ...] = ()
    rows = tuple(
        tuple(i for i, run in enumerate(runs) if run.protocol.control == control)
        for control in controls
    )
    parts = []
    for control, some in zip(controls, rows, strict=True):
        if control == "oscillation":
            part, moduli = _oscillations([runs[i] for i in some], strain_step)
        else:
            part = make[control]([runs[i] for i in some])
        parts.append(part)
    n = max(len(run) for run in runs)
    weight, recorded = zip(*(_measured(run, n) for run in runs), strict=True)
    return MixedBatch(tuple(parts), rows, moduli, np.stack(weight), np.stack(recorded))


def _measured(run: Run, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return weights and values of a run's samples, padded to a length."""
    size = np.full(len(run), np.sqrt(np.mean(run.recorded**2)))
    if run.protocol.control in ("steady", "oscillation"):
        # over decades of values the noise is in proportion to them, and each decade counts
        largest = float(np.max(np.abs(run.recorded)))
        size = np.maximum(np.abs(run.recorded), _LEAST_STEADY * largest)
    scale = 1.0 / (np.where(size > 0, size, 1.0) * np.sqrt(len(run)))
    pad = (0, n - len(run))
    return np.pad(scale, pad), np.pad(run.recorded, pad)


def even(weight: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return by what values of one run are divided so that their noise has one size.

    Ones but for a flow curve or a sweep, whose noise is in proportion to it.

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


def _oscillations(
    runs: Sequence[Run], strain_step: float
) -> tuple[OscillationBatch, tuple[tuple[int, int], ...]]:
    """Return the sweeps, and of each run which of them it is and which modulus of it."""
    sweeps: list[tuple[np.ndarray, np.ndarray]] = []
    moduli = []
    for run in runs:
        strain, frequency = np.asarray(run.strain), run.angular_frequency
        # G′ and G″ of one sweep are computed together
        at = next(
            (
                i
                for i, (other, beside) in enumerate(sweeps)
                if np.array_equal(other, strain) and np.array_equal(beside, frequency)
            ),
            len(sweeps),
        )
        if at == len(sweeps):
            sweeps.append((strain, frequency))
        moduli.append((at, MODULI.index(run.quantity)))
    n = max(len(strain) for strain, _ in sweeps)
    strains, frequencies = (
        jnp.asarray(np.stack([np.pad(v, (0, n - len(v)), mode="edge") for v in column]))
        for column in zip(*sweeps, strict=True)
    )
    # half a cycle goes through twice the amplitude
    largest = max(float(np.max(strain)) for strain, _ in sweeps)
    steps = int(min(np.ceil(max(2.0 * largest, _FEWEST_STEPS) / strain_step), _MOST_STEPS))
    phase = np.linspace(0.0, np.pi, 2 * steps + 1)
    phases = jnp.asarray(np.tile(phase, (len(sweeps), 1)))
    return OscillationBatch(strains, frequencies, phases), tuple(moduli)


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
                np.asarray(cycle),
            )
        )
    columns = [jnp.asarray(np.stack(column)) for column in zip(*rows, strict=True)]
    return RunBatch(
        *columns,
        kinematics=stack_kinematics([run.protocol.kinematics for run in runs]),
        cycle_steps=cycle_steps,
    )


def data_scales(runs: Sequence[Run]) -> dict[str, float]:
    """Return the size of the properties in which effects scale their first trials.

    Times are on the instrument's clock, but for ``run_time``, which is the material's.
    """
    sweeps = [run for run in runs if run.protocol.control == "oscillation"]
    timed = [run for run in runs if run.protocol.control != "oscillation"]
    gaps = [float(np.min(np.diff(run.time))) / run.clock_factor for run in timed if len(run) > 1]
    lengths = [float(run.time[-1]) / run.clock_factor for run in timed]
    strains = [
        float(np.sum(np.abs(run.rate[1:]) * np.diff(run.time)))
        + abs(float(run.rate[0])) * float(run.time[0])
        for run in timed
    ]
    strains += [float(np.max(np.abs(run.strain))) for run in sweeps if run.strain is not None]
    material_lengths = [float(run.time[-1]) for run in timed]
    # an oscillation changes within a radian; what is seen of it is a part of that
    radians = [1.0 / float(np.median(run.angular_frequency)) for run in sweeps]
    gaps += [_SEEN * radian for radian in radians]
    lengths, material_lengths = lengths + radians, material_lengths + radians
    stresses = [float(np.sqrt(np.mean(run.stress**2))) for run in runs]
    rates = [float(np.max(np.abs(run.rate))) for run in runs]
    stress, gap = float(np.median(stresses)) or 1.0, float(np.median(gaps or [1.0]))
    rate, length = float(np.median(rates)) or 1.0, float(np.median(lengths)) or 1.0
    return {
        "sampling_time": gap,
        "run_time": float(np.median(material_lengths)) or 1.0,
        "inverse_rate": 1.0 / rate,
        "strain": float(np.median(strains)) or 1.0,
        "stress": stress,
        "inverse_stress": 1.0 / stress,
        "fluidity": rate / stress,
        "viscosity": stress / rate,
        "stress_rate": stress / length,
        "inertia": stress * gap / rate,
    }
