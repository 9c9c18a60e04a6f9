"""What a check has to say, and doubts about runs, each alone and held against one another."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any, Literal, get_args

import numpy as np
import pandas as pd
from jaxtyping import Float

from discover.dataset.records.thinning import SPREAD_OF_BENDS, bends, without_spikes
from discover.dataset.run import Run
from discover.protocols.kinematics import KINDS
from discover.statistics.noise.noise_model import read_times
from discover.summary_view import NotebookView
from discover.words import counted

FEWEST_SAMPLES = 10  # runs with fewer say little about a law

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
_EQUAL = 1e-9  # range over the largest, up to which all values are one

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


error, warning, note = (partial(Finding, severity) for severity in get_args(Severity))


def doubts_of_run(run: Run) -> Iterator[Finding]:
    """Yield what is doubtful about a run by itself."""
    name, rate, stress = run.name, run.rate, run.stress
    source = str(run.metadata.get("shear_rate_source", ""))
    if "thinned" in run.metadata:
        yield note("samples", name, f"{name}: {run.metadata['thinned']}.")
    if source.startswith("derived"):
        yield note("rate", name, f"{name}: the shear rate is {source}.")
    if len(run) < FEWEST_SAMPLES:
        text = f"{name} has only {len(run)} samples; a fit needs {FEWEST_SAMPLES}."
        yield warning("samples", name, text)
    if run.protocol.control != "rate":
        yield from _at_given_stress(run)
    elif not run.flows:
        text = f"The shear rate in {name} is zero throughout, so nothing flows. Leave the run "
        yield warning("rate", name, f"{text}out, unless it follows a flow.")
    elif not np.any(stress):
        text = f"The stress in {name} is zero throughout. Check the column."
        yield warning("stress", name, text)
    elif len(run) > 2 and np.ptp(stress) <= _EQUAL * np.max(np.abs(stress)):
        text = f"The stress in {name} is the same in every sample: a steady value or a command "
        yield warning("stress", name, f"{text}rather than a record. Check the column.")
    elif len(run) > 2:
        yield from _of_samples(run)
        if run.strain is not None and "derived" not in source:
            yield from _of_strain(run, run.strain)
        turns = int(np.sum(np.diff(np.sign(rate[rate != 0])) != 0))
        varies = np.ptp(rate) > 1e-6 * np.max(np.abs(rate))
        if varies and turns > 1:
            yield from _of_cycles(run, turns)
        if not varies and run.from_rest and np.any(rate):
            yield from _of_rise(run)


def _at_given_stress(run: Run) -> Iterator[Finding]:
    """Yield what is doubtful of the strain that a given stress was answered with."""
    strain = run.recorded
    if np.ptp(strain) <= _EQUAL * np.max(np.abs(strain)):
        text = f"The strain in {run.name} is the same in every sample, whatever the stress. Check "
        yield warning("strain", run.name, f"{text}the column.")
    elif float(strain @ run.stress) < 0.0:
        text = f"The strain in {run.name} goes against the stress that is imposed. Change the sign "
        yield warning("strain", run.name, f"{text}of one of the two columns.")


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


def _of_samples(run: Run) -> Iterator[Finding]:
    """Yield spikes, values that are read several times, and a clock that began before the flow."""
    if found := without_spikes(run)[1]:
        where = ", ".join(f"{t:.6g}" for t in found[:4]) + (" …" if len(found) > 4 else "")
        count = "one sample" if len(found) == 1 else f"{len(found)} samples"
        text = f"The stress in {run.name} jumps out of line in {count} (time {where} s). Look at "
        yield warning("outliers", run.name, f"{text}them; remove them if the instrument made them.")
    if (often := read_times(run.stress)) > 1:
        text = (
            f"Each value of the stress in {run.name} stands in {often} samples: the "
            "transducer is read more often than it has values. Keep the first sample of each "
            "value, or what is late in the others looks like a lag."
        )
        yield warning("stress", run.name, text)
    if run.time[0] > 0.2 * run.time[-1]:
        text = (
            f"{run.name} starts at {run.time[0]:.4g} s of {run.time[-1]:.4g} s. Time counts from "
            "the start of the flow, from rest; if the clock started earlier, subtract its reading "
            "then."
        )
        yield warning("time", run.name, text)


def _of_strain(run: Run, strain: Float[np.ndarray, " n"]) -> Iterator[Finding]:
    """Hold a strain that was recorded against the sum of its rate."""
    steps = 0.5 * (run.rate[1:] + run.rate[:-1]) * np.diff(run.time)
    expected, measured = np.concatenate([[0.0], np.cumsum(steps)]), strain - strain[0]
    size = np.max(np.abs(expected))
    off = float(np.max(np.abs(measured - expected)) / size) if size > 0 else 0.0
    if off <= 0.1:
        return
    if np.max(np.abs(measured + expected)) < 0.1 * size:
        text = (
            f"The strain in {run.name} runs against its shear rate: one of the two has the wrong "
            "sign. If it is the rate, the stress has it too."
        )
    else:
        text = (
            f"The strain in {run.name} differs from its shear rate summed over time by up to "
            f"{100 * off:.0f} %. Check the units of both (per cent?), or whether the commanded "
            "rate was reached."
        )
    yield warning("strain", run.name, text)


def _of_cycles(run: Run, turns: int) -> Iterator[Finding]:
    """Hold cycles against the second law, and their samples against what harmonics need."""
    power = run.rate * run.stress
    work, size = np.trapezoid(power, run.time), np.trapezoid(np.abs(power), run.time)
    # noise around zero sums to some 1/√n of its size
    if run.from_rest and work < -max(_RETURNED_WORK, 3.0 / np.sqrt(len(run))) * size:
        text = (
            f"{run.name} returns {-100 * work / size:.0f} % of the work that its stress and rate "
            "exchange, and a fluid at rest before has none to return: the stress or the rate has "
            "the wrong sign, or one lags the other."
        )
        yield warning("stress", run.name, text)
    if (per_cycle := 2.0 * len(run) / turns) < _FEWEST_PER_CYCLE:
        text = (
            f"{run.name} has {per_cycle:.0f} samples a cycle (the rate changes its sign "
            f"{turns} times); harmonics need {_FEWEST_PER_CYCLE}. Sample faster, or smooth the "
            "rate if the sign changes are noise."
        )
        yield warning("sampling", run.name, text)


def _of_rise(run: Run) -> Iterator[Finding]:
    """Yield that the rise of a start-up is hardly seen, or its stress lost in noise."""
    stress, noise = run.stress * np.sign(run.rate[0]), stress_noise(run)
    half = int(np.argmax(stress >= 0.5 * np.max(stress)))
    if half < _FEWEST_ON_THE_RISE:
        text = (
            f"{run.name} has {half} samples before the stress reaches half its largest value, so "
            f"the start-up is hardly seen. Sample faster at the start, evenly in log time (at "
            f"least {_FEWEST_ON_THE_RISE})."
        )
        yield warning("sampling", run.name, text)
    lost = (np.abs(stress) < 3.0 * noise) | (stress < 0)
    if np.mean(lost) > 0.2:
        text = (
            f"{100 * float(np.mean(lost)):.0f} % of the stresses in {run.name} are below three "
            f"times their noise ({noise:.2g} Pa) or negative, the last at "
            f"{run.time[np.flatnonzero(lost)[-1]]:.4g} s: the transducer's floor. "
            "These samples teach nothing; a strain window ([loop] strain) leaves them out."
        )
        yield warning("stress", run.name, text)


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
                yield warning("units", run.name, text)


def doubts_of_temperature(runs: Sequence[Run]) -> Iterator[Finding]:
    """Doubts about runs at several temperatures whose times nobody shifted to one."""
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
    yield warning("temperature", "", text)


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
