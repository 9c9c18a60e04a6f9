"""Doubts about runs, each alone and held against one another."""

from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Float

from discover.dataset.checking.finding import Finding
from discover.dataset.records.thinning import beside_a_step
from discover.dataset.run import Run
from discover.protocols.kinematics import KINDS
from discover.statistics.noise.noise_model import read_times

FEWEST_SAMPLES = 10
"""Runs with fewer samples than this say little about a law."""

# A spike stands out of its neighbours by this many standard deviations of the local noise, and by
# this part of the largest stress: the first keeps noisy runs quiet, the second rounded ones
_SPIKE_SIGMAS = 10.0
_SPIKE_SHARE = 0.03

# Samples before half of the largest stress is reached, fewer of which leave the start-up to guess
_FEWEST_ON_THE_RISE = 5
_FEWEST_PER_CYCLE = 16
# The robust deviation; a sample minus the mean of two neighbours has variance 1 + 1/4 + 1/4
_SPREAD_OF_BENDS = 1.4826 / np.sqrt(1.5)
_NEIGHBOURHOOD = 31
_RETURNED_WORK = 0.1  # a lag of a tenth of a radian does less to an elastic fluid


def doubts_of_run(run: Run) -> Iterator[Finding]:
    """Yield what is doubtful about a run."""

    def warn(subject: str, text: str) -> Finding:
        return Finding("warning", subject, run.name, text)

    if "thinned" in run.metadata:
        yield Finding("note", "samples", run.name, f"{run.name}: {run.metadata['thinned']}.")
    if str(run.metadata.get("shear_rate_source", "")).startswith("derived"):
        source = run.metadata["shear_rate_source"]
        yield Finding("note", "rate", run.name, f"{run.name}: the shear rate is {source}.")
    if len(run) < FEWEST_SAMPLES:
        yield warn(
            "samples", f"{run.name} has only {len(run)} samples; a fit needs {FEWEST_SAMPLES}."
        )
    if run.protocol.control != "rate":
        yield from _at_given_stress(run)
        return
    if not run.flows:
        yield warn(
            "rate",
            f"The shear rate in {run.name} is zero throughout, so nothing flows. Leave the run "
            "out, unless it follows a flow.",
        )
        return
    if not np.any(run.stress):
        yield warn("stress", f"The stress in {run.name} is zero throughout. Check the column.")
        return
    if len(run) < 3:
        return
    if np.ptp(run.stress) <= 1e-9 * np.max(np.abs(run.stress)):
        yield warn(
            "stress",
            f"The stress in {run.name} is the same in every sample: a steady value or a command "
            "rather than a record. Check the column.",
        )
        return
    yield from _outliers(run)
    yield from _held_values(run)
    yield from _clock_start(run)
    yield from _strain(run)
    if np.ptp(run.rate) <= 1e-6 * np.max(np.abs(run.rate)):
        if run.from_rest and np.any(run.rate):
            yield from _start_up(run)
    else:
        yield from _cycles(run)


def _at_given_stress(run: Run) -> Iterator[Finding]:
    """Yield what is doubtful of the strain that a given stress was answered with."""
    strain = run.recorded
    if np.ptp(strain) <= 1e-9 * np.max(np.abs(strain)):
        text = (
            f"The strain in {run.name} is the same in every sample, whatever the stress. Check "
            "the column."
        )
        yield Finding("warning", "strain", run.name, text)
    elif float(strain @ run.stress) < 0.0:
        text = (
            f"The strain in {run.name} goes against the stress that is imposed. Change the sign "
            "of one of the two columns."
        )
        yield Finding("warning", "strain", run.name, text)


def spikes(run: Run) -> Float[np.ndarray, " k"]:
    """Return the times, in s, of single samples of stress that stand out of their neighbours.

    A sample is compared with the straight line between its neighbours. A lone spike also bends
    the lines at its neighbours the other way; a corner or a fast rise does not. Nor is a sample one
    that is next to a step of the rate.
    """
    off = _bends(run.time, run.stress)
    if len(off) < 5:
        return np.empty(0)
    width = min(41, len(off))
    first = np.clip(np.arange(len(off)) - width // 2, 0, len(off) - width)
    windows = np.lib.stride_tricks.sliding_window_view(np.abs(off), width)
    noise = 1.4826 * np.median(windows, axis=1)[first]
    large = np.abs(off) > np.maximum(
        _SPIKE_SIGMAS * noise, _SPIKE_SHARE * np.max(np.abs(run.stress))
    )
    alone = np.zeros(len(off), dtype=bool)
    alone[1:-1] = (off[1:-1] * off[:-2] < 0) & (off[1:-1] * off[2:] < 0)
    # the neighbours of a spike bend too, but less
    alone[1:-1] &= (np.abs(off[1:-1]) > np.abs(off[:-2])) & (np.abs(off[1:-1]) > np.abs(off[2:]))
    return run.time[1:-1][large & alone & ~beside_a_step(run)[1:-1]]


def stress_noise(run: Run) -> float:
    """Return the standard deviation of the sample-to-sample noise of the stress, in Pa."""
    off = _bends(run.time, run.stress)
    return float(_SPREAD_OF_BENDS * np.median(np.abs(off))) if len(off) else 0.0


def local_noise(time: Float[np.ndarray, " n"], values: Float[np.ndarray, " n"]):
    """Return the standard deviation of the noise around each sample of a record, shape (n,).

    `time` in s, increasing. `values` in any unit, which is that of the noise.
    """
    off = np.abs(_bends(time, values))
    if not len(off):
        return np.zeros(len(values))
    width = min(_NEIGHBOURHOOD, len(off))
    around = np.median(np.lib.stride_tricks.sliding_window_view(off, width), axis=1)
    return _SPREAD_OF_BENDS * np.pad(around, (width // 2 + 1, width - width // 2), mode="edge")


def _bends(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    share = (time[1:-1] - time[:-2]) / (time[2:] - time[:-2])
    return values[1:-1] - (values[:-2] + share * (values[2:] - values[:-2]))


def _outliers(run: Run) -> Iterator[Finding]:
    found = spikes(run)
    if len(found):
        where = ", ".join(f"{t:.6g}" for t in found[:4]) + (" …" if len(found) > 4 else "")
        count = "one sample" if len(found) == 1 else f"{len(found)} samples"
        text = (
            f"The stress in {run.name} jumps out of line in {count} (time {where} s). Look at "
            "them; remove them if the instrument made them."
        )
        yield Finding("warning", "outliers", run.name, text)


def _held_values(run: Run) -> Iterator[Finding]:
    """Yield that each value is read several times, where all are read as often."""
    if (often := read_times(run.stress)) > 1:
        text = (
            f"Each value of the stress in {run.name} stands in {often} samples: the "
            "transducer is read more often than it has values. Keep the first sample of each "
            "value, or what is late in the others looks like a lag."
        )
        yield Finding("warning", "stress", run.name, text)


def _clock_start(run: Run) -> Iterator[Finding]:
    if run.time[0] > 0.2 * run.time[-1]:
        text = (
            f"{run.name} starts at {run.time[0]:.4g} s of {run.time[-1]:.4g} s. Time counts from "
            "the start of the flow, from rest; if the clock started earlier, subtract its reading "
            "then."
        )
        yield Finding("warning", "time", run.name, text)


def _strain(run: Run) -> Iterator[Finding]:
    if run.strain is None or "derived" in str(run.metadata.get("shear_rate_source", "")):
        return
    steps = 0.5 * (run.rate[1:] + run.rate[:-1]) * np.diff(run.time)
    expected = np.concatenate([[0.0], np.cumsum(steps)])
    measured = run.strain - run.strain[0]
    size = np.max(np.abs(expected))
    off = float(np.max(np.abs(measured - expected)) / size) if size > 0 else 0.0
    if off > 0.1 and np.max(np.abs(measured + expected)) < 0.1 * size:
        text = (
            f"The strain in {run.name} runs against its shear rate: one of the two has the wrong "
            "sign. If it is the rate, the stress has it too."
        )
        yield Finding("warning", "strain", run.name, text)
    elif off > 0.1:
        text = (
            f"The strain in {run.name} differs from its shear rate summed over time by up to "
            f"{100 * off:.0f} %. Check the units of both (per cent?), or whether the commanded "
            "rate was reached."
        )
        yield Finding("warning", "strain", run.name, text)


def _start_up(run: Run) -> Iterator[Finding]:
    stress = run.stress * np.sign(run.rate[0])
    half = int(np.argmax(stress >= 0.5 * np.max(stress)))
    if half < _FEWEST_ON_THE_RISE:
        text = (
            f"{run.name} has {half} samples before the stress reaches half its largest value, so "
            f"the start-up is hardly seen. Sample faster at the start, evenly in log time (at "
            f"least {_FEWEST_ON_THE_RISE})."
        )
        yield Finding("warning", "sampling", run.name, text)
    noise = stress_noise(run)
    low = np.abs(stress) < 3.0 * noise
    below = float(np.mean(low | (stress < 0)))
    if below > 0.2:
        last = run.time[np.flatnonzero(low | (stress < 0))[-1]]
        text = (
            f"{100 * below:.0f} % of the stresses in {run.name} are below three times their noise "
            f"({noise:.2g} Pa) or negative, the last at {last:.4g} s: the transducer's floor. "
            "These samples teach nothing; a strain window ([loop] strain) leaves them out."
        )
        yield Finding("warning", "stress", run.name, text)


def _cycles(run: Run) -> Iterator[Finding]:
    turns = int(np.sum(np.diff(np.sign(run.rate[run.rate != 0])) != 0))
    if turns < 2:
        return
    if run.from_rest:
        yield from _work(run)
    per_cycle = 2.0 * len(run) / turns
    if per_cycle < _FEWEST_PER_CYCLE:
        text = (
            f"{run.name} has {per_cycle:.0f} samples a cycle (the rate changes its sign {turns} "
            f"times); harmonics need {_FEWEST_PER_CYCLE}. Sample faster, or smooth the rate if "
            "the sign changes are noise."
        )
        yield Finding("warning", "sampling", run.name, text)


def _work(run: Run) -> Iterator[Finding]:
    """Hold the work of an oscillation from rest against zero, below which no passive fluid goes."""
    power = run.rate * run.stress
    work = float(np.trapezoid(power, run.time))
    size = float(np.trapezoid(np.abs(power), run.time))
    # noise around zero sums to some 1/√n of its size
    if work < -max(_RETURNED_WORK, 3.0 / np.sqrt(len(run))) * size:
        text = (
            f"{run.name} returns {-100 * work / size:.0f} % of the work that its stress and rate "
            "exchange, and a fluid at rest before has none to return: the stress or the rate has "
            "the wrong sign, or one lags the other."
        )
        yield Finding("warning", "stress", run.name, text)


# Units differ by 60, 100 or 1000; what fluids do beyond the bounds below (they thicken, yield or
# band) stays within this factor
_UNIT_FACTOR = 30.0

_ONE_TEMPERATURE = 2.0
"""In °C. Times change by 2 to 10 % a degree (Ferry 1980, ch. 11), so that less than this is within
the gain and the noise of most records."""


def is_start_up(run: Run) -> bool:
    """Return whether a run is at one rate, in three samples or more."""
    rate = run.rate
    return bool(len(run) >= 3 and rate[0] != 0 and np.ptp(rate) <= 1e-6 * np.max(np.abs(rate)))


def doubts_among_runs(runs: Sequence[Run]) -> Iterator[Finding]:
    """Yield which start-ups do not go together with the others.

    In a faster start-up the largest stress is no smaller, and larger by the ratio of the rates at
    most, as viscosities do not rise with the rate; half of it is reached no later, and earlier by
    that ratio at most, which is the same strain. Shear thickening and yielding break these rules by
    less than another unit of stress or of time does. Another unit of rate may pass for thinning.

    `runs`: those that load; less than two start-ups say nothing.
    """
    for kind in KINDS:  # the stress of an extension is not that of a shear at the same rate
        alike = [r for r in runs if r.flow == kind and r.from_rest and is_start_up(r)]
        yield from _among_alike(alike)


def doubts_of_temperature(runs: Sequence[Run]) -> Iterator[Finding]:
    """Yield that runs at several temperatures are taken for those of one fluid, if they are.

    `runs`: those whose times nobody has shifted to one temperature, with ``temperature_C`` of
    runs.csv.
    """
    told = {run.name: run.metadata.get("temperature_C") for run in runs}
    known = {name: float(t) for name, t in told.items() if isinstance(t, int | float)}
    if not known or max(known.values()) - min(known.values()) <= _ONE_TEMPERATURE:
        return
    coldest, hottest = min(known, key=known.__getitem__), max(known, key=known.__getitem__)
    text = (
        f"{coldest} was measured at {known[coldest]:g} °C and {hottest} at {known[hottest]:g} °C, "
        "and relaxation times change by some per cent a degree: one law for both looks like a "
        "missing effect. Fit the runs of one temperature ([data] fit), or shift their times to one "
        "and name the column of the factors ([data] clock_factor)."
    )
    yield Finding("warning", "temperature", "", text)


def _among_alike(start_ups: Sequence[Run]) -> Iterator[Finding]:
    if len(start_ups) < 2:
        return
    rates = np.array([abs(run.rate[0]) for run in start_ups])
    for what, quantity, rises in (
        ("The stress", _largest, True),
        ("The time at which the stress rises", _half_time, False),
    ):
        values = np.array([quantity(run) for run in start_ups])
        for run, ratio in zip(start_ups, _least_outside(values, rates, rises), strict=True):
            if abs(np.log(ratio)) < np.log(_UNIT_FACTOR):
                continue
            large = f"{ratio:.2g} times too large"
            size = large if ratio > 1.0 else f"{1.0 / ratio:.2g} times too small"
            text = (
                f"{what} in {run.name} is at least {size} for its shear rate, compared with the "
                "other start-ups. Check the units of its stress and time (kPa for Pa, ms for s)."
            )
            yield Finding("warning", "units", run.name, text)


def _largest(run: Run) -> float:
    return float(np.max(np.abs(run.stress)))


def _half_time(run: Run) -> float:
    stress = np.abs(run.stress)
    return float(run.time[int(np.argmax(stress >= 0.5 * np.max(stress)))])


def _least_outside(
    values: Float[np.ndarray, " n"], rates: Float[np.ndarray, " n"], rises: bool
) -> Float[np.ndarray, " n"]:
    """Return by which factor each run is outside what the others allow; 1 inside.

    Of two nobody knows which is wrong, and both are named; of more, a run is held against the one
    that it fits best.
    """
    found = np.ones(len(values))
    if not np.all(values > 0.0):
        return found
    for i in range(len(values)):
        reference, share = np.delete(values, i), rates[i] / np.delete(rates, i)
        bound = reference * (share if rises else 1.0 / share)
        low, high = np.minimum(reference, bound), np.maximum(reference, bound)
        ratios = values[i] / np.clip(values[i], low, high)
        found[i] = ratios[np.argmin(np.abs(np.log(ratios)))]
    return found
