"""What a check has to say, and doubts about runs, each alone and held against one another."""

import tomllib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from importlib.resources import files
from typing import Any, Literal, get_args

import numpy as np
import pandas as pd
from jaxtyping import Float

from discover.dataset.records.thinning import SPREAD_OF_BENDS, bends, without_spikes
from discover.dataset.run import Run
from discover.statistics.noise_model import hold_length
from discover.summary_view import NotebookView
from discover.words import counted

FEWEST_SAMPLES = 10  # runs with fewer say little about a law

# Samples before half of the largest stress is reached, fewer of which leave the start-up to guess
_FEWEST_ON_THE_RISE = 5
_FEWEST_PER_CYCLE = 16
_NEIGHBOURHOOD = 31
_RETURNED_WORK = 0.1  # a lag of a tenth of a radian does less to an elastic fluid
# In °C. Times change by 2 to 10 % a degree (Ferry 1980, ch. 11): within the gain of most records
_ONE_TEMPERATURE = 2.0
_EQUAL = 1e-9  # range over the largest, up to which all values are one

Severity = Literal["error", "warning", "note"]
Values = Float[np.ndarray, " n"]


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong, doubtful or worth knowing.

    An ``error``: the folder cannot be used; a ``warning``: results may mislead.
    """

    severity: Severity
    subject: str  # such as ``outliers`` or ``N1``; the same word for the same kind
    file: str  # empty if it is about the folder
    text: str  # a sentence or two in the user's words, with the remedy

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


@cache
def _checks() -> dict[str, Any]:
    file = files("discover.dataset.checking") / "checks.toml"
    return tomllib.loads(file.read_text("utf-8"))


def found(check: str, file: str = "", **values: Any) -> Finding:
    """Return what a check of ``checks.toml`` says of a file, with the values in its text."""
    severity, subject, text = _checks()[check]
    return Finding(severity, subject, file, text.format(file=file, **values))


def doubts_of_run(run: Run) -> Iterator[Finding]:
    """Yield what is doubtful about a run by itself."""
    name, rate, stress = run.name, run.rate, run.stress
    source = str(run.metadata.get("shear_rate_source", ""))
    if "thinned" in run.metadata:
        yield found("thinned", name, how=run.metadata["thinned"])
    if source.startswith("derived"):
        yield found("derived", name, how=source)
    if len(run) < FEWEST_SAMPLES:
        yield found("few_samples", name, samples=counted(len(run), "sample"), fewest=FEWEST_SAMPLES)
    if run.protocol.control != "rate":
        strain = run.recorded
        if np.ptp(strain) <= _EQUAL * np.max(np.abs(strain)):
            yield found("constant_strain", name)
        elif float(strain @ stress) < 0.0:
            yield found("strain_against_stress", name)
    elif not run.flows:
        yield found("no_flow", name)
    elif not np.any(stress):
        yield found("no_stress", name)
    elif len(run) > 2 and np.ptp(stress) <= _EQUAL * np.max(np.abs(stress)):
        yield found("constant_stress", name)
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


def stress_noise(run: Run) -> float:
    """Return the standard deviation of the sample-to-sample noise of the stress, in Pa."""
    off = bends(run.time, run.stress)
    return float(SPREAD_OF_BENDS * np.median(np.abs(off))) if len(off) else 0.0


def local_noise(time: Values, values: Values) -> Values:
    """Return the standard deviation of the noise around each sample of a record, shape (n,)."""
    off = np.abs(bends(time, values))
    if not len(off):
        return np.zeros(len(values))
    width = min(_NEIGHBOURHOOD, len(off))
    around = np.median(np.lib.stride_tricks.sliding_window_view(off, width), axis=1)
    return SPREAD_OF_BENDS * np.pad(around, (width // 2 + 1, width - width // 2), mode="edge")


def _of_samples(run: Run) -> Iterator[Finding]:
    if spikes := without_spikes(run)[1]:
        where = ", ".join(f"{t:.6g}" for t in spikes[:4]) + (" …" if len(spikes) > 4 else "")
        count = "one sample" if len(spikes) == 1 else f"{len(spikes)} samples"
        yield found("spikes", run.name, count=count, where=where)
    if (often := hold_length(run.stress)) > 1:
        yield found("held_values", run.name, times=often)
    if run.time[0] > 0.2 * run.time[-1]:
        yield found("late_start", run.name, first=run.time[0], last=run.time[-1])


def _of_strain(run: Run, strain: Values) -> Iterator[Finding]:
    steps = 0.5 * (run.rate[1:] + run.rate[:-1]) * np.diff(run.time)
    expected, measured = np.concatenate([[0.0], np.cumsum(steps)]), strain - strain[0]
    size = np.max(np.abs(expected))
    off = float(np.max(np.abs(measured - expected)) / size) if size > 0 else 0.0
    if off > 0.1 and np.max(np.abs(measured + expected)) < 0.1 * size:
        yield found("strain_against_rate", run.name)
    elif off > 0.1:
        yield found("strain_off", run.name, percent=100 * off)


def _of_cycles(run: Run, turns: int) -> Iterator[Finding]:
    """Hold cycles against the second law, and their samples against what harmonics need."""
    power = run.rate * run.stress
    work, size = np.trapezoid(power, run.time), np.trapezoid(np.abs(power), run.time)
    # noise around zero sums to some 1/√n of its size
    if run.from_rest and work < -max(_RETURNED_WORK, 3.0 / np.sqrt(len(run))) * size:
        yield found("returned_work", run.name, percent=-100 * work / size)
    if (samples := 2.0 * len(run) / turns) < _FEWEST_PER_CYCLE:
        counts = {"samples": samples, "turns": turns, "fewest": _FEWEST_PER_CYCLE}
        yield found("few_in_a_cycle", run.name, **counts)


def _of_rise(run: Run) -> Iterator[Finding]:
    stress, noise = run.stress * np.sign(run.rate[0]), stress_noise(run)
    half = int(np.argmax(stress >= 0.5 * np.max(stress)))
    if half < _FEWEST_ON_THE_RISE:
        yield found(
            "few_on_the_rise", run.name, samples=counted(half, "sample"), fewest=_FEWEST_ON_THE_RISE
        )
    lost = (np.abs(stress) < 3.0 * noise) | (stress < 0)
    if np.mean(lost) > 0.2 and len(run) >= FEWEST_SAMPLES:  # fewer show no noise
        last = run.time[np.flatnonzero(lost)[-1]]
        percent = 100 * float(np.mean(lost))
        yield found("lost_in_noise", run.name, percent=percent, noise=noise, last=last)


def is_start_up(run: Run) -> bool:
    """Return whether a run is at one rate, in three samples or more."""
    rate = run.rate
    return bool(len(run) >= 3 and rate[0] != 0 and np.ptp(rate) <= 1e-6 * np.max(np.abs(rate)))


def steady_stress(run: Run) -> float | None:
    """Return the size of the stress in the last fifth, if it changes by less than a tenth there."""
    tail = run.stress[run.time > 0.8 * run.time[-1]]
    level = abs(float(np.median(tail))) if len(tail) else 0.0
    return level if len(tail) >= 3 and np.ptp(tail) < 0.1 * level else None


def doubts_of_temperature(runs: Sequence[Run]) -> Iterator[Finding]:
    """Doubts about runs at several temperatures whose times nobody shifted to one."""
    known = {run.name: at for run in runs if (at := run.temperature_C) is not None}
    if known and max(known.values()) - min(known.values()) > _ONE_TEMPERATURE:
        cold, hot = min(known, key=known.__getitem__), max(known, key=known.__getitem__)
        names: dict[str, Any] = {"cold": cold, "hot": hot}
        yield found("two_temperatures", **names, lowest=known[cold], highest=known[hot])
