"""Sizes of the data, in which effects scale their first trials."""

from collections.abc import Sequence

import numpy as np

from discover.dataset import Run
from discover.statistics.projection import rms

# Of a radian: the time in which a change of a periodic stress is seen, in its phase
_SEEN = 0.1


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
    stresses = [rms(run.stress) for run in runs]
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
        "rate": rate,
        "inertia": stress * gap / rate,
    }
