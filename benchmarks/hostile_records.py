"""Records of hostile data sets: makers of runs and tables without noise, and changes of them.

A maker takes nothing and returns runs by file name; a change takes the name and the run. The tables
of cases name what is here.
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

    def told(self, **columns: np.ndarray) -> "Record":
        """Return the run with other columns."""
        return replace(self, columns={**self.columns, **columns})

    def kept(self, which) -> "Record":
        """Return the run with some of its samples."""
        columns = {name: values[which] for name, values in self.columns.items()}
        normal = [None if n is None else n[which] for n in (self.N1, self.N2)]
        return replace(self, columns=columns, N1=normal[0], N2=normal[1])


Runs = dict[str, Record]
Change = Callable[[str, Record], Record]
Tables = dict[str, dict[str, np.ndarray]]


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
_GROWTH = FLOWS["slow.csv"][1]
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
CUT = {
    name: (flow, times[: {"fast.csv": 10, "wave.csv": 30}.get(name)])
    for name, (flow, times) in FLOWS.items()
}


def late(begin: float) -> Sampled:
    """Return the flows, recorded from a time after their start."""
    return {name: (flow, times[times >= begin]) for name, (flow, times) in FLOWS.items()}


def to_strain(strain: float) -> Sampled:
    """Return start-ups that end at a strain."""
    rates = {"a.csv": 0.5, "b.csv": 1.0, "c.csv": 2.0, "d.csv": 4.0, "held.csv": 3.0}
    return {n: (start_up(r), np.linspace(0.02, strain / r, 60)) for n, r in rates.items()}


def record_of(run, **cells) -> Record:
    """Return a recording of an instrument as a run."""
    columns = {"time_s": run.time, "shear_rate_1_s": run.rate, "stress_Pa": run.stress}
    columns |= {} if run.strain is None else {"strain": run.strain}
    known = run.N1 is not None and np.all(np.isfinite(run.true.N1))
    return Record(columns, "stress_Pa", cells, *((run.true.N1, run.true.N2) if known else ()))


def recorded(material: Material = UCM, flows: Sampled = FLOWS, **faults: float) -> Runs:
    """Return runs at a given rate on one instrument."""
    return {
        name: record_of(Instrument(**faults).record(material, *flow))
        for name, flow in flows.items()
    }


def on_instruments(faults: Mapping[str, Mapping[str, float]], law: RateLaw = GIESEKUS) -> Runs:
    """Return runs, some of them on instruments with faults, by name."""
    return {
        name: record_of(Instrument(**faults.get(name, {})).record(law, *flow))
        for name, flow in FLOWS.items()
    }


def batches(fluids: Mapping[str, Material]) -> Runs:
    """Return runs of a Giesekus fluid, some of them of another, by name."""
    return {
        name: recorded(fluids.get(name, GIESEKUS), {name: flow})[name]
        for name, flow in FLOWS.items()
    }


def warmed(factors: Mapping[str, float]) -> Runs:
    """Return runs at temperatures that drift: a relaxation time for each."""
    return batches({n: replace(GIESEKUS, relaxation_time=LAMBDA * f) for n, f in factors.items()})


def of_plates(names: Sequence[str]) -> Runs:
    """Return runs of which some come from plates, torque not corrected."""
    return batches({name: PlatePlate(GIESEKUS) for name in names})


def only(name: str, material: Material) -> Runs:
    return recorded(material, {name: FLOWS[name]})


def each(change: Change, material: Material = GIESEKUS, flows: Sampled = FLOWS, names=None) -> Runs:
    """Return runs that are changed, all or those of some names."""
    return {
        name: change(name, run) if names is None or name in names else run
        for name, run in recorded(material, flows).items()
    }


def from_time(runs: Runs, begin: float) -> Runs:
    return {n: run.kept(run.columns["time_s"] >= begin) for n, run in runs.items()}


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


def told_otherwise(true: Callable[[str, Flow], Flow], law: RateLaw = GIESEKUS) -> Runs:
    """Return runs in other flows than are told of them."""
    made = {}
    for name, (flow, times) in FLOWS.items():
        run = record_of(Instrument().record(law, true(name, flow), times))
        made[name] = run.told(shear_rate_1_s=np.asarray(flow.rate(times), float) + 0.0 * times)
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


def triggered(late: Mapping[str, float]) -> Runs:
    """Return runs whose clocks started late, each by so many s."""
    made = {}
    for name, (flow, times) in FLOWS.items():
        run = record_of(Instrument().record(GIESEKUS, flow, times + late.get(name, 0.0)))
        made[name] = run.told(time_s=times)
    return made


def without_rest(rest: float, law: RateLaw = GIESEKUS) -> Runs:
    """Return runs one after another, with so many s of rest, each from a new zero."""
    state, made = law.rest(), {}
    for name, (flow, times) in FLOWS.items():
        states = integrate(
            lambda t, s, flow=flow: law.change(s, float(flow.rate(t))), state, times,
            scale=law.scale(),
        )  # fmt: skip
        rate = np.asarray(flow.rate(times), float) + np.zeros(len(times))
        true = differences([law.stress(s, r) for s, r in zip(states, rate, strict=True)])
        zero = law.stress(state, 0.0)[0, 1]
        columns = {"time_s": times, "shear_rate_1_s": rate, "stress_Pa": true.sigma12 - zero}
        made[name] = Record(columns, N1=true.N1, N2=true.N2)
        state = integrate(
            lambda t, s: law.change(s, 0.0), states[-1], np.array([rest]), scale=law.scale()
        )[-1]
    return made


def interpolated_onto(points: int, interval: float = 0.1) -> Runs:
    """Return start-ups recorded evenly in time, exported evenly in log t by lines."""
    even = {
        name: (flow, np.arange(1, round(times[-1] / interval) + 1) * interval)
        for name, (flow, times) in STARTS.items()
    }
    made = {}
    for name, run in recorded(GIESEKUS, even).items():
        known = np.append(0.0, run.columns["time_s"])
        times = np.geomspace(0.02, known[-1], points)
        told, *normal = (
            np.interp(times, known, np.append(0.0, values))
            for values in (run.columns["stress_Pa"], run.N1, run.N2)
        )
        rate = np.asarray(STARTS[name][0].rate(times), float) + 0.0 * times
        columns = {"time_s": times, "shear_rate_1_s": rate, "stress_Pa": told}
        made[name] = replace(run, columns=columns, N1=normal[0], N2=normal[1])
    return made


def of_blocks(every: int) -> Runs:
    """Return runs of which so many neighbours each are told as their mean."""
    fine = {
        n: (flow, t[0] / every + np.arange(len(t) * every) * (t[1] - t[0]) / every)
        for n, (flow, t) in FLOWS.items()
    }
    made = {}
    for name, run in recorded(GIESEKUS, fine).items():
        block = {k: v.reshape(-1, every).mean(axis=1) for k, v in run.columns.items()}
        rate = np.asarray(FLOWS[name][0].rate(block["time_s"]), float)
        block["shear_rate_1_s"] = rate + np.zeros(len(block["time_s"]))
        normal = [n.reshape(-1, every).mean(axis=1) for n in (run.N1, run.N2)]
        made[name] = replace(run, columns=block, N1=normal[0], N2=normal[1])
    return made
