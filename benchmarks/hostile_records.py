"""Records of hostile data sets: makers of runs without noise, and changes of them.

A maker returns runs by file name; a change takes the name and the run. The cases of
``hostile.toml`` name what is here.
"""

import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from hostile_benches import PlatePlate
from independent import (
    Flow,
    Giesekus,
    Material,
    PomPom,
    RateLaw,
    UpperConvectedMaxwell,
    of_rate,
    oscillation,
    start_up,
    steps,
)
from independent.instruments import Instrument
from independent.material import differences, integrate

G, LAMBDA = 100.0, 1.0
SCALE = {"modulus": G, "relaxation_time": LAMBDA}
UCM, GIESEKUS = UpperConvectedMaxwell(**SCALE), Giesekus(0.3, **SCALE)
POM_POM = PomPom(5.0, 0.4, **SCALE)
Sampled = dict[str, tuple[Flow, np.ndarray]]


@dataclass(frozen=True)
class Record:
    """One run: columns of its file, which of them gets noise, cells of the table of runs.

    N1 and N2 are those of the fluid in Pa; None where nobody knows them.
    """

    columns: dict[str, np.ndarray]
    observed: str = "stress_Pa"
    cells: Mapping[str, Any] = field(default_factory=dict)
    N1: np.ndarray | None = None
    N2: np.ndarray | None = None

    @property
    def time(self) -> np.ndarray:
        """Return the times that are told."""
        return self.columns["time_s"]

    def told(self, **columns: np.ndarray) -> "Record":
        """Return the run with other columns."""
        return replace(self, columns={**self.columns, **columns})

    def mapped(self, change: Callable[[np.ndarray], np.ndarray]) -> "Record":
        """Return the run with all its series changed in the same way."""
        columns = {name: change(values) for name, values in self.columns.items()}
        normal = [None if n is None else change(n) for n in (self.N1, self.N2)]
        return replace(self, columns=columns, N1=normal[0], N2=normal[1])

    def kept(self, which) -> "Record":
        """Return the run with some of its samples."""
        return self.mapped(lambda values: values[which])


Runs = dict[str, Record]
Change = Callable[[str, Record], Record]


def flow_of(told: Mapping[str, Any]) -> tuple[Flow, np.ndarray]:
    """Return a flow, which is a rate, a wave or steps, and its samples, even in t or in log t."""
    made = {"rate": start_up, "wave": oscillation, "steps": steps}
    (flow,) = (make(*told[how]) for how, make in made.items() if how in told)
    times = np.linspace(*told["even"]) if "even" in told else np.geomspace(*told["log"])
    return flow, np.union1d(times, told["and"]) if "and" in told else times


FILE = tomllib.loads((Path(__file__).parent / "hostile.toml").read_text("utf-8"))
SAMPLED: dict[str, Sampled] = {
    name: {run: flow_of(one) for run, one in runs.items()} for name, runs in FILE["flows"].items()
}
FLOWS, STARTS, BAD_DAYS = (SAMPLED[name] for name in ("FLOWS", "STARTS", "BAD_DAYS"))
_LOT = np.random.default_rng(7)
UNEVEN: Sampled = {
    name: (flow, np.sort(_LOT.uniform(0.02, times[-1], len(times))))
    for name, (flow, times) in FLOWS.items()
}
AGAIN = {**FLOWS, "again.csv": FLOWS["fast.csv"]}
REPEATED = {
    one: flow
    for name, flow in FLOWS.items()
    for one in ([name] if name == "held.csv" else [name, name.replace(".csv", "_again.csv")])
}
CUT = {n: (flow, t[: {"fast.csv": 10, "wave.csv": 30}.get(n)]) for n, (flow, t) in FLOWS.items()}


def late(begin: float) -> Sampled:
    """Return the flows, recorded from a time after their start."""
    return {name: (flow, times[times >= begin]) for name, (flow, times) in FLOWS.items()}


def to_strain(strain: float) -> Sampled:
    """Return start-ups that end at a strain."""
    rates = {"a.csv": 0.5, "b.csv": 1.0, "c.csv": 2.0, "d.csv": 4.0, "held.csv": 3.0}
    return {n: (start_up(r), np.linspace(0.02, strain / r, 60)) for n, r in rates.items()}


def rates_of(flow: Flow, times: np.ndarray) -> np.ndarray:
    return np.asarray(flow.rate(times), float) + np.zeros(len(times))


def record_of(run, **cells) -> Record:
    """Return a recording of an instrument as a run."""
    columns = {"time_s": run.time, "shear_rate_1_s": run.rate, "stress_Pa": run.stress}
    columns |= {} if run.strain is None else {"strain": run.strain}
    known = run.N1 is not None and np.all(np.isfinite(run.true.N1))
    return Record(columns, "stress_Pa", cells, *((run.true.N1, run.true.N2) if known else ()))


def recorded(material: Material = UCM, flows: Sampled = FLOWS, **faults: float) -> Runs:
    """Return runs at a given rate on one instrument."""
    record = Instrument(**faults).record
    return {name: record_of(record(material, *flow)) for name, flow in flows.items()}


def on_instruments(faults: Mapping[str, Mapping[str, float]], law: RateLaw = GIESEKUS) -> Runs:
    """Return runs, some of them on instruments with faults, by name."""
    return {n: recorded(law, {n: flow}, **faults.get(n, {}))[n] for n, flow in FLOWS.items()}


def batches(fluids: Mapping[str, Material]) -> Runs:
    """Return runs of a Giesekus fluid, some of them of another, by name."""
    return {n: recorded(fluids.get(n, GIESEKUS), {n: flow})[n] for n, flow in FLOWS.items()}


def warmed(factors: Mapping[str, float]) -> Runs:
    """Return runs at temperatures that drift: a relaxation time for each."""
    return batches({n: replace(GIESEKUS, relaxation_time=LAMBDA * f) for n, f in factors.items()})


def shifted(factors: Mapping[str, Sequence[float]]) -> Runs:
    """Return runs at several temperatures by factors of time that are told, and that are true."""
    runs = warmed({name: true / told for name, (told, true) in factors.items()})
    return {n: replace(run, cells={"a_T": factors[n][0]}) for n, run in runs.items()}


def of_plates(names: Sequence[str]) -> Runs:
    """Return runs of which some come from plates, torque not corrected."""
    return batches({name: PlatePlate(GIESEKUS) for name in names})


def only(name: str, material: Material) -> Runs:
    return recorded(material, {name: FLOWS[name]})


# changes


def each(change: Change, material: Material = GIESEKUS, flows: Sampled = FLOWS, names=None) -> Runs:
    """Return runs that are changed, all or those of some names."""
    return {
        name: change(name, run) if names is None or name in names else run
        for name, run in recorded(material, flows).items()
    }


def column(told: Callable, what: str = "stress_Pa", silent: bool = False) -> Change:
    """Return the change of a column; with `silent` nobody knows the normal stresses.

    `told` is a function of the run's name, its times, stresses and rates.
    """

    def change(name: str, run: Record) -> Record:
        c = run.columns
        run = run.told(**{what: told(name, c["time_s"], c["stress_Pa"], c["shear_rate_1_s"])})
        return replace(run, N1=None, N2=None) if silent else run

    return change


def of_stress(told: Callable, silent: bool = False) -> Change:
    return column(told, "stress_Pa", silent)


def kept(where: Callable[[np.ndarray], np.ndarray]) -> Change:
    """Return the change of a record of which samples at some times are left."""
    return lambda name, run: run.kept(where(run.time))


def later_zero(begin: float) -> Change:
    """Return the change of a record whose clock was started after the flow."""

    def change(name: str, run: Record) -> Record:
        left = run.kept(run.time > begin)
        return left.told(time_s=left.time - begin)

    return change


def with_first_difference(told: Callable[..., np.ndarray]) -> Change:
    """Return the change of a record that has N1 too, as it is told, with 1 % noise."""

    def change(name: str, run: Record) -> Record:
        lot = np.random.default_rng(letters(name))
        read = told(run.time, run.columns["shear_rate_1_s"], run.N1, run.N2)
        read = read + 0.01 * np.sqrt(np.mean(run.N1**2)) * lot.standard_normal(len(read))
        return run.told(N1_Pa=read)

    return change


def late_axially(lag: float):
    """Return N1 behind a soft axis: it follows with a time."""

    def told(times, rates, N1, N2):
        out, last, before = np.zeros(len(times)), 0.0, 0.0
        for i, (t, value) in enumerate(zip(times, N1, strict=True)):
            last = value + (last - value) * np.exp(-(t - before) / lag)
            out[i], before = last, t
        return out

    return told


def fractured(n, t, s, r):
    """Return the stress behind an edge that loses a third of its area over a strain of 1."""
    rate = np.abs(r)
    first = rate[0] * t[0]
    strain = np.concatenate([[first], first + np.cumsum((rate[1:] + rate[:-1]) / 2 * np.diff(t))])
    return s * (1 - 0.33 / (1 + np.exp(-(strain - 5.0) / 0.4)))


def wound(t, r):
    return np.cumsum(r * np.diff(t, prepend=0.0))


def letters(name: str) -> int:
    return sum(map(ord, name))


def place(name: str) -> int:
    return list(FLOWS).index(name)


def strain_of(name: str, times: np.ndarray) -> np.ndarray:
    return FLOWS[name][0].strain(times)


def shaken(what: str, law: RateLaw, flows: Sampled, seed: int, told: Callable) -> Runs:
    """Return runs of which a column is told as a function of it and of a lot for all runs."""
    lot = np.random.default_rng(seed)
    return {
        name: run.told(**{what: told(run.columns[what], lot)})
        for name, run in recorded(law, flows).items()
    }


# other flows than are told, and other samples


def told_otherwise(true: Callable[[str, Flow], Flow], law: RateLaw = GIESEKUS) -> Runs:
    """Return runs in other flows than are told of them."""
    made = {}
    for name, (flow, times) in FLOWS.items():
        run = record_of(Instrument().record(law, true(name, flow), times))
        made[name] = run.told(shear_rate_1_s=rates_of(flow, times))
    return made


def ramped(rise: float, law: RateLaw) -> Runs:
    """Return runs whose rate rises evenly over so many s, told as a step."""

    def true(name, flow):
        end = FLOWS[name][1][-1]
        risen = of_rate(lambda t: flow.rate(t) * np.minimum(np.asarray(t) / rise, 1.0), end)
        return replace(risen, jumps=(rise,))

    return told_otherwise(true, law)


def distorted(third: float) -> Runs:
    """Return runs whose wave has a third harmonic that nobody told."""

    def true(name, flow):
        return flow if name != "wave.csv" else Flow(
            lambda t: flow.rate(t) + third * np.cos(3 * np.asarray(t)),
            lambda t: flow.strain(t) + third * np.sin(3 * np.asarray(t)) / 3,
        )  # fmt: skip

    return told_otherwise(true)


def triggered(begin: Mapping[str, float]) -> Runs:
    """Return runs whose clocks started late, each by so many s."""
    flows = {name: (flow, t + begin.get(name, 0.0)) for name, (flow, t) in FLOWS.items()}
    return {n: run.told(time_s=FLOWS[n][1]) for n, run in recorded(GIESEKUS, flows).items()}


def averaged(width: float, since: bool = False, flows: Sampled = FLOWS) -> Runs:
    """Return runs told as means over a width in s about each sample, or before it."""
    made = {}
    for name, (flow, times) in flows.items():
        if since:
            fine = np.linspace(0.0, times[-1], 6001)
            stress = np.append(0.0, GIESEKUS.respond(flow, fine[1:]).sigma12)
            low, high, over = np.maximum(times - width, 0.0), times, width
        else:
            fine = np.linspace(1e-3, times[-1] + width, 6000)
            stress = GIESEKUS.respond(flow, fine).sigma12
            low, high = np.maximum(times - width / 2, 1e-3), times + width / 2
            over = high - low
        total = np.append(0.0, np.cumsum((stress[1:] + stress[:-1]) / 2 * np.diff(fine)))
        mean = (np.interp(high, fine, total) - np.interp(low, fine, total)) / over
        run = record_of(Instrument().record(GIESEKUS, flow, times))
        made[name] = run.told(stress_Pa=mean)
    return made


def from_time(runs: Runs, begin: float) -> Runs:
    return {n: run.kept(run.time >= begin) for n, run in runs.items()}


def without_rest(rest: float, law: RateLaw = GIESEKUS) -> Runs:
    """Return runs one after another, with so many s of rest, each from a new zero."""
    state, made = law.rest(), {}
    for name, (flow, times) in FLOWS.items():

        def change(t, s, flow=flow):
            return law.change(s, float(flow.rate(t)))

        states = integrate(change, state, times, scale=law.scale())
        rate = rates_of(flow, times)
        true = differences([law.stress(s, r) for s, r in zip(states, rate, strict=True)])
        zero = law.stress(state, 0.0)[0, 1]
        columns = {"time_s": times, "shear_rate_1_s": rate, "stress_Pa": true.sigma12 - zero}
        made[name] = Record(columns, N1=true.N1, N2=true.N2)
        still = integrate(
            lambda t, s: law.change(s, 0.0), states[-1], np.array([rest]), scale=law.scale()
        )
        state = still[-1]
    return made


def interpolated_onto(points: int, interval: float = 0.1) -> Runs:
    """Return start-ups recorded evenly in time, exported evenly in log t by lines."""
    even = {
        name: (flow, np.arange(1, round(times[-1] / interval) + 1) * interval)
        for name, (flow, times) in STARTS.items()
    }
    made = {}
    for name, run in recorded(GIESEKUS, even).items():
        known = np.append(0.0, run.time)
        times = np.geomspace(0.02, known[-1], points)
        told = run.mapped(lambda v, at=times, known=known: np.interp(at, known, np.append(0.0, v)))
        made[name] = told.told(time_s=times, shear_rate_1_s=rates_of(STARTS[name][0], times))
    return made


def of_blocks(every: int) -> Runs:
    """Return runs of which so many neighbours each are told as their mean."""
    fine = {
        n: (flow, t[0] / every + np.arange(len(t) * every) * (t[1] - t[0]) / every)
        for n, (flow, t) in FLOWS.items()
    }
    made = {}
    for name, run in recorded(GIESEKUS, fine).items():
        block = run.mapped(lambda values: values.reshape(-1, every).mean(axis=1))
        made[name] = block.told(shear_rate_1_s=rates_of(FLOWS[name][0], block.time))
    return made


# what becomes of runs that have their noise


def copied(runs: Runs, which: str, to: str, places: int = 0) -> Runs:
    """Return runs of which one has two names, once with fewer digits."""
    stress = runs[which].columns["stress_Pa"]
    told = np.array([float(f"{v:.{places}g}") for v in stress]) if places else stress
    return {**runs, to: runs[which].told(stress_Pa=told)}


def filled_up(runs: Runs, end: float, names: Sequence[str], last: bool) -> Runs:
    """Return runs that stopped early, filled with their last value or with zeros."""
    made = dict(runs)
    for name in names:
        stress = runs[name].columns["stress_Pa"].copy()
        over = runs[name].time > end
        stress[over] = stress[~over][-1] if last else 0.0
        made[name] = runs[name].told(stress_Pa=stress)
    return made
