"""Sizes of what the data are, in which effects scale their first trials and ranges."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from discover.dataset.run import Run
from discover.statistics.noise.noise_model import rms

# Of a radian: the time in which a change of a periodic stress is seen, in its phase
_SEEN = 0.1


def data_scales(runs: Sequence[Run], others: Sequence[Run] = ()) -> dict[str, float]:
    """Return the size of the properties in which effects scale their first trials.

    Times are on the instrument's clock, but for ``run_time``, which is the material's. Of `others`
    the temperatures count, and the shifts to these.
    """
    sweeps = [run for run in runs if run.protocol.control == "oscillation"]
    timed = [run for run in runs if run.protocol.control != "oscillation"]
    gaps = [float(np.min(np.diff(run.time))) / run.clock_factor for run in timed if len(run) > 1]
    lengths = [float(run.time[-1]) / run.clock_factor for run in timed]
    strains = [
        float(np.sum(np.abs(run.rate[1:]) * np.diff(run.time)))
        + abs(float(run.rate[0])) * float(run.time[0])
        + (0.0 if run.strain is None else abs(float(run.strain[0])))
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
    strain = float(np.median(strains)) or 1.0
    return {
        "sampling_time": gap,
        "run_time": float(np.median(material_lengths)) or 1.0,
        "inverse_rate": 1.0 / rate,
        "strain": strain,
        "stress": stress,
        "inverse_stress": 1.0 / stress,
        "compliance": min(1.0, strain) / stress,  # that of a tool does not depend on the strain
        "fluidity": rate / stress,
        "viscosity": stress / rate,
        "stress_rate": stress / length,
        "rate": rate,
        "inertia": stress * gap / rate,
        "softening_by_heat": softening_by_heat([*runs, *others]),
        "shift_factor": float(np.median([run.clock_factor for run in runs])),
    }


_GLASS = 0.8
"""−d ln a_T/dT at a glass transition, in 1/K   [Ferry 1980, ch. 11: 2.303 · 17.44/51.6 K]."""

_HEAT_CAPACITY = 1e6
"""Least heat capacity per volume of a liquid, in J/(m³ K)."""


def softening_by_heat(runs: Sequence[Run]) -> float:
    """Return by how much a unit of work can shorten relaxation times by its heat, in 1/Pa.

    −d ln a_T/dT is the steepest between two temperatures to whose shift factors runs were shifted;
    that of a glass transition where these are not known.
    """
    shifts = {
        round(run.temperature_C): np.log(run.clock_factor)
        for run in runs
        if run.temperature_C is not None
    }
    at = sorted(shifts)
    slopes = [(shifts[b] - shifts[a]) / (b - a) for a, b in pairwise(at)]
    steepest = max(slopes, default=0.0)
    return (steepest if steepest > 0.0 else _GLASS) / _HEAT_CAPACITY
