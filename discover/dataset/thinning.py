"""Fewer samples of a very long record, chosen so that what a law is judged on stays."""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float
from scipy.integrate import cumulative_trapezoid

from discover.dataset.run import Run
from discover.protocols.protocol import in_flow, measured_rate

MOST_SAMPLES = 20_000
"""A record with more samples is thinned: they cost time and say nothing new about a law."""


MOST_FREQUENCIES = 400
"""A sweep with more is thinned: 40 a decade over ten decades, where instruments give 5 to 20."""

_FOLLOWED = 1e-3
"""Error of the strain, over its range, up to which the samples kept follow the rate."""


def thin(
    time: Float[np.ndarray, " n"],
    shear_rate: Float[np.ndarray, " n"],
    shear_stress: Float[np.ndarray, " n"],
    most: int = MOST_SAMPLES,
) -> tuple[Bool[np.ndarray, " n"], str]:
    """Return which samples to keep, and a word on what was kept.

    Kept are the first and the last sample; samples evenly spaced in log time, since a start-up has
    its information per decade; samples evenly spaced in time, since an oscillation has it per
    cycle; and the largest and smallest stress and rate. Values are the recorded ones, and all but
    those four are chosen by their time alone, so that noise keeps its size and distribution.

    Parameters
    ----------
    time
        Sampling times in s, increasing.
    shear_rate
        In 1/s.
    shear_stress
        In Pa.
    most
        How many samples may stay.
    """
    n = len(time)
    keep = np.zeros(n, dtype=bool)
    if n <= most:
        keep[:] = True
        return keep, f"kept all {n:,} samples"
    keep[[0, -1]] = True
    half = (most - 6) // 2
    positive = time[time > 0]
    keep[_nearest(time, np.geomspace(positive[0], positive[-1], half))] = True
    keep[_nearest(time, np.linspace(time[0], time[-1], half))] = True
    for values in (shear_stress, shear_rate):
        keep[[int(np.argmin(values)), int(np.argmax(values))]] = True
    lost = _strain_error(time, shear_rate, keep)
    note = (
        f"kept {int(keep.sum()):,} of {n:,} samples: half evenly in log time, half "
        "evenly in time, and the extremes of stress and rate"
    )
    if lost > _FOLLOWED:
        note += (
            f"; the strain between them is then off by {100 * lost:.2g} % of its range, so the "
            "rate varies faster than the samples kept: give a shorter record"
        )
    return keep, note


def thin_sweep(
    angular_frequency: Float[np.ndarray, " n"], most: int = MOST_FREQUENCIES
) -> tuple[Bool[np.ndarray, " n"], str]:
    """Return which frequencies of a sweep to keep, and a word on what was kept; none if all were.

    Kept are those nearest to frequencies evenly spaced in log frequency, with their moduli as they
    were recorded.

    Parameters
    ----------
    angular_frequency
        In rad/s, positive and increasing; some may be repeated.
    most
        How many may stay.
    """
    n = len(angular_frequency)
    if n <= most:
        return np.ones(n, dtype=bool), ""
    position = np.log(angular_frequency)
    keep = np.zeros(n, dtype=bool)
    if position[-1] > position[0]:
        keep[_nearest(position, np.linspace(position[0], position[-1], most - 2))] = True
    keep[[0, -1]] = True
    note = f"kept {int(keep.sum()):,} of {n:,} frequencies, evenly in log frequency"
    return keep, note


def evenly_chosen(n: int, most: int) -> Bool[np.ndarray, " n"]:
    """Return which of n samples to keep so that at most so many stay, evenly in their order.

    Parameters
    ----------
    n
        How many there are.
    most
        How many may stay, 2 or more.
    """
    keep = np.zeros(n, dtype=bool)
    keep[np.unique(np.round(np.linspace(0, n - 1, min(n, most))).astype(int))] = True
    return keep


def thin_run(run: Run, most: int) -> Run:
    """Return a run with at most so many of its samples, evenly chosen in their order.

    A rate that was read sample by sample is followed through the samples kept where that changes
    the strain by less than 0.1 % of its range, and through all of them otherwise.

    Parameters
    ----------
    run
        The run.
    most
        How many samples may stay, 2 or more.
    """
    n = len(run)
    if n <= most:
        return run
    keep = evenly_chosen(n, most)
    thinned = run.window(keep)
    sampled = np.array_equal(np.asarray(run.protocol.table_times), run.time)
    if (
        run.protocol.control == "rate"
        and sampled
        and _strain_error(run.time, run.rate, keep) < _FOLLOWED
    ):
        followed = measured_rate(thinned.time, thinned.rate)
        thinned = replace(thinned, protocol=in_flow(followed, run.flow))
    return thinned


def _nearest(time: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    after = np.clip(np.searchsorted(time, wanted), 1, len(time) - 1)
    return after - (wanted - time[after - 1] < time[after] - wanted)


def _strain_error(time: np.ndarray, rate: np.ndarray, keep: np.ndarray) -> float:
    """Return the largest error of the integrated rate at the samples kept, over its range."""
    whole = cumulative_trapezoid(rate, time, initial=0.0)
    part = cumulative_trapezoid(rate[keep], time[keep], initial=0.0)
    return float(np.max(np.abs(part - whole[keep])) / max(np.ptp(whole), 1e-300))
