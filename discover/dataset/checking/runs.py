"""What a check has to say, and doubts about runs, each alone and held against one another."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal, get_args

import numpy as np
import pandas as pd
from jaxtyping import Float

from discover.dataset.records.thinning import SPREAD_OF_BENDS, bends, beside_a_step
from discover.dataset.run import Run
from discover.protocols.kinematics import KINDS
from discover.statistics.noise.noise_model import read_times
from discover.summary_view import NotebookView
from discover.words import counted

FEWEST_SAMPLES = 10  # runs with fewer say little about a law

# A spike stands out of its neighbours by this many standard deviations of the local noise, and by
# this part of the largest stress: the first keeps noisy runs quiet, the second rounded ones
_SPIKE_SIGMAS, _SPIKE_SHARE = 10.0, 0.03
# Samples before half of the largest stress is reached, fewer of which leave the start-up to guess
_FEWEST_ON_THE_RISE = 5
_FEWEST_PER_CYCLE = 16
_NEIGHBOURHOOD = 31
_RETURNED_WORK = 0.1  # a lag of a tenth of a radian does less to an elastic fluid
# Units differ by 60, 100 or 1000; what fluids do beyond the bounds below (they thicken, yield or
# band) stays within this factor
_UNIT_FACTOR = 30.0
# In °C. Times change by 2 to 10 % a degree (Ferry 1980, ch. 11): within the gain of most records
_ONE_TEMPERATURE = 2.0


Severity = Literal["error", "warning", "note"]


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong, doubtful or worth knowing.

    Attributes
    ----------
    severity
        ``error``: the folder cannot be used; ``warning``: it can, but results may mislead;
        ``note``: how something was understood.
    subject
        What it is about, such as ``outliers`` or ``N1``; the same word for the same kind.
    file
        The file, or empty if it is about the folder.
    text
        A sentence or two in the user's words, with the remedy.
    """

    severity: Severity
    subject: str
    file: str
    text: str

    def __str__(self) -> str:
        return self.text


class Findings(tuple[Finding, ...], NotebookView):
    """All that a check has to say, errors first; a tuple that shows itself in a notebook."""

    __slots__ = ()

    def of(self, severity: Severity) -> list[Finding]:
        """Return the findings of one severity."""
        return [finding for finding in self if finding.severity == severity]

    @property
    def counts(self) -> str:
        """How many there are of each severity, in words."""
        return ", ".join(counted(len(self.of(one)), one) for one in get_args(Severity))

    def _shown(self) -> Iterable[Any]:
        yield f"{self.counts}." if self else "Nothing wrong was found."
        yield pd.DataFrame([asdict(finding) for finding in self])


def doubts_of_run(run: Run) -> Iterator[Finding]:
    """Yield what is doubtful about a run."""
    source = str(run.metadata.get("shear_rate_source", ""))
    if "thinned" in run.metadata:
        yield Finding("note", "samples", run.name, f"{run.name}: {run.metadata['thinned']}.")
    if source.startswith("derived"):
        yield Finding("note", "rate", run.name, f"{run.name}: the shear rate is {source}.")
    if len(run) < FEWEST_SAMPLES:
        text = f"{run.name} has only {len(run)} samples; a fit needs {FEWEST_SAMPLES}."
        yield Finding("warning", "samples", run.name, text)
    if run.protocol.control != "rate":
        doubts = _at_given_stress(run)
    elif unusable := _unusable(run):
        doubts = (unusable,)
    elif len(run) < 3:
        doubts = ()
    else:
        doubts = (
            _outliers(run), _held_values(run), _clock_start(run),
            None if "derived" in source else _strain(run), *_by_course(run),
        )  # fmt: skip
    for subject, text in filter(None, doubts):
        yield Finding("warning", subject, run.name, text)


Doubt = tuple[str, str] | None
"""Subject and text of a warning, if there is one."""


def _unusable(run: Run) -> Doubt:
    if not run.flows:
        return "rate", (
            f"The shear rate in {run.name} is zero throughout, so nothing flows. Leave the run "
            "out, unless it follows a flow."
        )
    if not np.any(run.stress):
        return "stress", f"The stress in {run.name} is zero throughout. Check the column."
    if len(run) > 2 and np.ptp(run.stress) <= 1e-9 * np.max(np.abs(run.stress)):
        return "stress", (
            f"The stress in {run.name} is the same in every sample: a steady value or a command "
            "rather than a record. Check the column."
        )
    return None


def _at_given_stress(run: Run) -> Iterator[Doubt]:
    """Yield what is doubtful of the strain that a given stress was answered with."""
    strain = run.recorded
    if np.ptp(strain) <= 1e-9 * np.max(np.abs(strain)):
        text = (
            f"The strain in {run.name} is the same in every sample, whatever the stress. Check "
            "the column."
        )
        yield "strain", text
    elif float(strain @ run.stress) < 0.0:
        text = (
            f"The strain in {run.name} goes against the stress that is imposed. Change the sign "
            "of one of the two columns."
        )
        yield "strain", text


def spikes(run: Run) -> Float[np.ndarray, " k"]:
    """Return the times, in s, of single samples of stress that stand out of their neighbours.

    A sample is compared with the straight line between its neighbours. A lone spike also bends
    the lines at its neighbours the other way; a corner or a fast rise does not. Nor is a sample one
    that is next to a step of the rate.
    """
    off = bends(run.time, run.stress)
    if len(off) < 5:
        return np.empty(0)
    width = min(41, len(off))
    first = np.clip(np.arange(len(off)) - width // 2, 0, len(off) - width)
    windows = np.lib.stride_tricks.sliding_window_view(np.abs(off), width)
    noise = 1.4826 * np.median(windows, axis=1)[first]
    size = np.abs(off)
    large = size > np.maximum(_SPIKE_SIGMAS * noise, _SPIKE_SHARE * np.max(np.abs(run.stress)))
    alone = np.zeros(len(off), dtype=bool)
    alone[1:-1] = (off[1:-1] * off[:-2] < 0) & (off[1:-1] * off[2:] < 0)
    # the neighbours of a spike bend too, but less
    alone[1:-1] &= (size[1:-1] > size[:-2]) & (size[1:-1] > size[2:])
    return run.time[1:-1][large & alone & ~beside_a_step(run)[1:-1]]


def stress_noise(run: Run) -> float:
    """Return the standard deviation of the sample-to-sample noise of the stress, in Pa."""
    off = bends(run.time, run.stress)
    return float(SPREAD_OF_BENDS * np.median(np.abs(off))) if len(off) else 0.0


def local_noise(time: Float[np.ndarray, " n"], values: Float[np.ndarray, " n"]):
    """Return the standard deviation of the noise around each sample of a record, shape (n,)."""
    off = np.abs(bends(time, values))
    if not len(off):
        return np.zeros(len(values))
    width = min(_NEIGHBOURHOOD, len(off))
    around = np.median(np.lib.stride_tricks.sliding_window_view(off, width), axis=1)
    return SPREAD_OF_BENDS * np.pad(around, (width // 2 + 1, width - width // 2), mode="edge")


def _outliers(run: Run) -> Doubt:
    found = spikes(run)
    if not len(found):
        return None
    where = ", ".join(f"{t:.6g}" for t in found[:4]) + (" …" if len(found) > 4 else "")
    count = "one sample" if len(found) == 1 else f"{len(found)} samples"
    return "outliers", (
        f"The stress in {run.name} jumps out of line in {count} (time {where} s). Look at "
        "them; remove them if the instrument made them."
    )


def _held_values(run: Run) -> Doubt:
    """Return that each value is read several times, where all are read as often."""
    often = read_times(run.stress)
    return None if often <= 1 else ("stress", (
        f"Each value of the stress in {run.name} stands in {often} samples: the "
        "transducer is read more often than it has values. Keep the first sample of each "
        "value, or what is late in the others looks like a lag."
    ))  # fmt: skip


def _clock_start(run: Run) -> Doubt:
    return None if run.time[0] <= 0.2 * run.time[-1] else ("time", (
        f"{run.name} starts at {run.time[0]:.4g} s of {run.time[-1]:.4g} s. Time counts from "
        "the start of the flow, from rest; if the clock started earlier, subtract its reading "
        "then."
    ))  # fmt: skip


def _strain(run: Run) -> Doubt:
    if run.strain is None:
        return None
    steps = 0.5 * (run.rate[1:] + run.rate[:-1]) * np.diff(run.time)
    expected = np.concatenate([[0.0], np.cumsum(steps)])
    measured = run.strain - run.strain[0]
    size = np.max(np.abs(expected))
    off = float(np.max(np.abs(measured - expected)) / size) if size > 0 else 0.0
    if off <= 0.1:
        return None
    if np.max(np.abs(measured + expected)) < 0.1 * size:
        return "strain", (
            f"The strain in {run.name} runs against its shear rate: one of the two has the wrong "
            "sign. If it is the rate, the stress has it too."
        )
    return "strain", (
        f"The strain in {run.name} differs from its shear rate summed over time by up to "
        f"{100 * off:.0f} %. Check the units of both (per cent?), or whether the commanded "
        "rate was reached."
    )


def _by_course(run: Run) -> Iterator[Doubt]:
    """Yield what is doubtful of a start-up, or of cycles."""
    varies = np.ptp(run.rate) > 1e-6 * np.max(np.abs(run.rate))
    turns = int(np.sum(np.diff(np.sign(run.rate[run.rate != 0])) != 0))
    if varies and turns > 1:
        yield _returned_work(run) if run.from_rest else None
        per_cycle = 2.0 * len(run) / turns
        if per_cycle < _FEWEST_PER_CYCLE:
            text = (
                f"{run.name} has {per_cycle:.0f} samples a cycle (the rate changes its sign "
                f"{turns} times); harmonics need {_FEWEST_PER_CYCLE}. Sample faster, or smooth the "
                "rate if the sign changes are noise."
            )
            yield "sampling", text
    if varies or not run.from_rest or not np.any(run.rate):
        return
    stress, noise = run.stress * np.sign(run.rate[0]), stress_noise(run)
    half = int(np.argmax(stress >= 0.5 * np.max(stress)))
    if half < _FEWEST_ON_THE_RISE:
        text = (
            f"{run.name} has {half} samples before the stress reaches half its largest value, so "
            f"the start-up is hardly seen. Sample faster at the start, evenly in log time (at "
            f"least {_FEWEST_ON_THE_RISE})."
        )
        yield "sampling", text
    lost = (np.abs(stress) < 3.0 * noise) | (stress < 0)
    if np.mean(lost) > 0.2:
        text = (
            f"{100 * float(np.mean(lost)):.0f} % of the stresses in {run.name} are below three "
            f"times their noise ({noise:.2g} Pa) or negative, the last at "
            f"{run.time[np.flatnonzero(lost)[-1]]:.4g} s: the transducer's floor. "
            "These samples teach nothing; a strain window ([loop] strain) leaves them out."
        )
        yield "stress", text


def _returned_work(run: Run) -> Doubt:
    """Hold the work of an oscillation from rest against zero, below which no passive fluid goes."""
    power = run.rate * run.stress
    work, size = np.trapezoid(power, run.time), np.trapezoid(np.abs(power), run.time)
    # noise around zero sums to some 1/√n of its size
    if work >= -max(_RETURNED_WORK, 3.0 / np.sqrt(len(run))) * size:
        return None
    return "stress", (
        f"{run.name} returns {-100 * work / size:.0f} % of the work that its stress and rate "
        "exchange, and a fluid at rest before has none to return: the stress or the rate has "
        "the wrong sign, or one lags the other."
    )


def is_start_up(run: Run) -> bool:
    """Return whether a run is at one rate, in three samples or more."""
    rate = run.rate
    return bool(len(run) >= 3 and rate[0] != 0 and np.ptp(rate) <= 1e-6 * np.max(np.abs(rate)))


def steady_stress(run: Run) -> float | None:
    """Return the size of the stress in the last fifth, if it changes by less than a tenth there."""
    tail = run.stress[run.time > 0.8 * run.time[-1]]
    level = abs(float(np.median(tail))) if len(tail) else 0.0
    return level if len(tail) >= 3 and np.ptp(tail) < 0.1 * level else None


def doubts_among_runs(runs: Sequence[Run]) -> Iterator[Finding]:
    """Yield which start-ups, of runs that load, do not go together with the others.

    In a faster start-up the largest stress is no smaller, and larger by the ratio of the rates at
    most, as viscosities do not rise with the rate; half of it is reached no later, and earlier by
    that ratio at most, which is the same strain. Shear thickening and yielding break these rules by
    less than another unit of stress or of time does. Another unit of rate may pass for thinning.
    """
    for kind in KINDS:  # the stress of an extension is not that of a shear at the same rate
        alike = [r for r in runs if r.flow == kind and r.from_rest and is_start_up(r)]
        if len(alike) < 2:
            continue
        rates = np.array([abs(run.rate[0]) for run in alike])
        for what, quantity, rises in (
            ("The stress", _largest, True),
            ("The time at which the stress rises", _half_time, False),
        ):
            values = np.array([quantity(run) for run in alike])
            for run, ratio in zip(alike, _least_outside(values, rates, rises), strict=True):
                if abs(np.log(ratio)) < np.log(_UNIT_FACTOR):
                    continue
                times = "times too large" if ratio > 1.0 else "times too small"
                text = (
                    f"{what} in {run.name} is at least {max(ratio, 1.0 / ratio):.2g} {times} for "
                    "its shear rate, compared with the other start-ups. Check the units of its "
                    "stress and time (kPa for Pa, ms for s)."
                )
                yield Finding("warning", "units", run.name, text)


def doubts_of_temperature(runs: Sequence[Run]) -> Iterator[Finding]:
    """Yield that runs at several temperatures are taken for those of one fluid, if they are.

    `runs`: those whose times nobody has shifted to one temperature.
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
