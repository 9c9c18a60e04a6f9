"""Fewer samples: of very long records, and without those that a knock or a spark made."""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import make_lsq_spline

from discover.dataset.run import Run
from discover.protocols.protocol import in_flow, measured_rate
from discover.statistics.noise_model import hold_length
from discover.statistics.outliers import isolated_outliers

# a record with more samples is thinned: they cost time and say nothing new about a law
MOST_SAMPLES = 20_000
_FOLLOWED = 1e-3  # error of the strain, over its range, up to which samples kept follow the rate
_FOLLOWED_RATE = 0.05  # error of the rate, over its largest, up to which straight lines follow it
_CORNER = 0.01  # share of the largest rate, or stress, that was imposed
_ABOVE_BENDS = 10.0  # times the median bend: a sine, or a rate that was measured, has none so sharp


def thin(
    time: Float[np.ndarray, " n"],
    shear_rate: Float[np.ndarray, " n"],
    shear_stress: Float[np.ndarray, " n"],
) -> tuple[Bool[np.ndarray, " n"], str]:
    """Return which samples to keep, half even in log time, half in time, and a word on it."""
    n = len(time)
    keep = np.zeros(n, dtype=bool)
    keep[[0, -1]] = True
    half = (MOST_SAMPLES - 6) // 2
    positive = time[time > 0]
    keep[nearest(time, np.geomspace(positive[0], positive[-1], half))] = True
    keep[nearest(time, np.linspace(time[0], time[-1], half))] = True
    for values in (shear_stress, shear_rate):
        keep[[int(np.argmin(values)), int(np.argmax(values))]] = True
    return keep, (
        f"kept {int(keep.sum()):,} of {n:,} samples: half evenly in log time, half evenly in time, "
        "and the extremes of stress and rate"
    )


def evenly_chosen(n: int, most: int) -> Bool[np.ndarray, " n"]:
    """Return which of n samples to keep so that at most so many, 2 or more, stay in even order."""
    keep = np.zeros(n, dtype=bool)
    keep[np.unique(np.round(np.linspace(0, n - 1, min(n, most))).astype(int))] = True
    return keep


def thin_run(run: Run, most: int) -> Run:
    """Thin a run evenly to so many samples, 2 or more; its rate is a `followed_rate`."""
    n = len(run)
    if n <= most:
        return run
    keep = evenly_chosen(n, most)
    text = f"kept {int(keep.sum()):,} of {n:,} samples, evenly in their order"
    if "thinned" in run.metadata:  # when it was read, which may warn of what was lost
        text = f"{run.metadata['thinned']}; of these {text}"
    thinned = replace(run.window(keep), metadata={**run.metadata, "thinned": text})
    times, rates = (np.asarray(run.protocol.table_times), np.asarray(run.protocol.table_rates))
    # a smooth rate has knots between its samples
    from_rest = run.protocol.control == "rate" and float(run.protocol.begins) == 0.0
    if from_rest and len(times) >= n and np.all(np.isin(run.time, times)):
        kept = np.isin(times, run.time[keep])
        followed = measured_rate(*followed_rate(times, rates, kept))
        thinned = replace(thinned, protocol=in_flow(followed, run.flow))
    return thinned


def followed_rate(
    time: Float[np.ndarray, " n"], shear_rate: Float[np.ndarray, " n"], keep: Bool[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
    """Return fewer knots that follow a rate: 0.1 % of the strain, 5 % of the largest rate."""
    weights = np.sqrt(np.gradient(time))
    strain = cumulative_trapezoid(shear_rate, time, initial=0.0)
    most = _FOLLOWED * np.ptp(strain), _FOLLOWED_RATE * np.max(np.abs(shear_rate))
    knots = np.union1d(np.flatnonzero(keep), [0, len(time) - 1])
    while len(knots) < len(time):
        at = time[knots]
        spline = make_lsq_spline(time, shear_rate, np.r_[at[0], at, at[-1]], k=1, w=weights)
        found = np.asarray(spline(time))
        off = cumulative_trapezoid(found - shear_rate, time, initial=0.0)
        # the strain gained or lost inside each interval: what is off later began earlier
        begun = np.repeat(off[knots[:-1]], np.diff(knots))
        gained = np.maximum.reduceat(np.abs(off[:-1] - begun), knots[:-1])
        apart = np.maximum.reduceat(np.abs(found - shear_rate)[:-1], knots[:-1])
        halved = apart > most[1]
        if np.max(np.abs(off)) > most[0]:
            halved |= gained >= 0.5 * np.max(gained)
        if not np.any(halved):
            return at, found[knots]
        middle = ((knots[:-1] + knots[1:]) // 2)[halved & (np.diff(knots) > 1)]
        if not middle.size:
            break
        knots = np.union1d(knots, middle)
    return time, shear_rate


def nearest(time: Float[np.ndarray, " n"], wanted: np.ndarray) -> np.ndarray:
    """Return the places of the times, increasing, that are nearest to those wanted."""
    return np.searchsorted(0.5 * (time[1:] + time[:-1]), wanted)


# The robust deviation; a sample minus the mean of two neighbours has variance 1 + 1/4 + 1/4
SPREAD_OF_BENDS = 1.4826 / np.sqrt(1.5)


def bends(place: Float[np.ndarray, " n"], values: Float[np.ndarray, " n"]) -> np.ndarray:
    """Return what samples lie off the straight line between their neighbours, shape (n - 2,)."""
    share = (place[1:-1] - place[:-2]) / (place[2:] - place[:-2])
    return values[1:-1] - (values[:-2] + share * (values[2:] - values[:-2]))


def next_to_a_step(run: Run) -> Bool[np.ndarray, " n"]:
    """Which samples are next to a step or corner of rate or stress, whichever was imposed."""
    imposed = run.stress if run.protocol.control == "stress" else run.rate
    beside = np.zeros(len(imposed), dtype=bool)
    if len(imposed) < 3:
        return beside
    bends = np.abs(np.diff(imposed, 2))
    sharp = bends > _CORNER * np.max(np.abs(imposed)) + _ABOVE_BENDS * np.median(bends)
    for shift in range(3):
        beside[shift : shift + len(sharp)] |= sharp
    return beside


def without_spikes(run: Run) -> tuple[Run, list[float]]:
    """Return a run without samples that stand alone in the record, and their times in s."""
    off = isolated_outliers(run.recorded) & ~next_to_a_step(run)
    if not np.any(off):
        return run, []
    return run.window(~off), [float(t) for t in run.time[off]]


def without_held_values(run: Run) -> Run:
    """Keep the first sample of each value that is held: one read again fits as a lag."""
    times = hold_length(run.recorded)
    if times == 1:
        return run
    fresh = np.diff(run.recorded, prepend=np.nan) != 0.0
    text = (
        f"kept {int(fresh.sum()):,} of {len(run):,} samples: each value stands in {times}, and the "
        "first is when it was measured"
    )
    return replace(run.window(fresh), metadata={**run.metadata, "thinned": text})
