"""Runs on padded grids, so that all of them share one compilation."""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from discover.dataset import Run
from discover.protocols.kinematics import Kinematics, stack_kinematics
from discover.protocols.protocol import shear_rates
from discover.simulate.grid import make_grid

# An instrument effect acts within the first samples, so the first gap is divided this often
_EARLY_STEPS = 0.5 ** np.arange(6)

# Runs of more steps than this go on in steps that grow while the rate is constant: most of so long
# a run is steady. Shorter ones keep the accuracy of small steps throughout
_LONG, _GROWTH = 2000, 0.05


class RunBatch(eqx.Module):
    """Runs on padded grids, with a leading axis of runs.

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
        1/(rms stress · √samples) at samples, 0 at padding: the squared residuals of a run then
        sum to its squared relative error.
    stress
        Measured stress in Pa, shape (runs, n).
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
    stress: Float[Array, "runs n"]
    clock_factor: Float[Array, " runs"]
    strain_before: Float[Array, " runs"]
    kinematics: Kinematics | None = None


def make_batch(runs: Sequence[Run], strain_step: float = 0.25) -> RunBatch:
    """Return runs as a batch.

    Parameters
    ----------
    runs
        One or more runs.
    strain_step
        Largest strain of one step.
    """
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
        n = len(run)
        size = np.sqrt(np.mean(run.recorded**2))
        scale = 1.0 / ((size if size > 0 else 1.0) * np.sqrt(n))
        pad = (0, n_samples - n)
        rows.append(
            (
                half,
                rate,
                np.pad(index, pad, mode="edge"),
                np.pad(np.full(n, scale), pad),
                np.pad(run.recorded, pad),
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
