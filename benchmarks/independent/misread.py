"""Records that are sound, and taken for what they are not."""

from dataclasses import replace

import numpy as np

from independent.flow import oscillation, step_strain
from independent.instruments import Instrument, Recording
from independent.material import Material, Stresses

_PERFECT = Instrument()


def relaxation_as_run(
    material: Material, strain: float, rise: float, times: np.ndarray
) -> Recording:
    """Return the relaxation after a step of strain, from its end on, with its measured strain.

    The step takes `rise` seconds, before the first sample; the file says nothing of it, so the run
    looks as if it began at rest with a rate of zero and a strain that is there already.
    """
    times = np.asarray(times, float)
    whole = _PERFECT.record(material, step_strain(strain, rise), times + rise)
    zero = np.zeros_like(times)
    return replace(
        whole, time=times, rate=zero, felt_rate=zero, tool_rate=zero, strain=zero + strain
    )


def alternation_as_from_rest(
    material: Material, amplitude: float, frequency: float, times: np.ndarray, cycles: int = 10
) -> Recording:
    """Return γ̇ = amplitude cos(ωt) in steady alternation, with its time counted from a crest."""
    times = np.asarray(times, float)
    late = times + cycles * 2 * np.pi / frequency
    whole = _PERFECT.record(material, oscillation(amplitude, frequency), late)
    return replace(whole, time=times)


def scaled(recording: Recording, stress: float = 1.0, time: float = 1.0) -> Recording:
    """Return a record whose stress or time is written in another unit than its column says."""
    return replace(recording, stress=stress * recording.stress, time=time * recording.time)


def nothing(recording: Recording, level: float) -> Recording:
    """Return a record of the same times and rates without a fluid: a constant stress in Pa."""
    flat = np.full_like(recording.stress, level)
    zero = np.zeros_like(flat)
    return replace(recording, stress=flat, true=Stresses(zero, zero, zero), N1=None, N2=None)
