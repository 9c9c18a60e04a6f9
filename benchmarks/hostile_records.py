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
from hostile_materials import PlatePlate
from independent import (
    Flow,
    Giesekus,
    Material,
    Modes,
    PomPom,
    RateLaw,
    UpperConvectedMaxwell,
    of_rate,
    oscillation,
    start_up,
    step_strain,
    steps,
)
from independent.instruments import Instrument, alternation_as_from_rest, nothing, relaxation_as_run
from independent.material import differences, integrate
from independent.sweeps import strain_at
from scipy.integrate import solve_ivp

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
Maker = Callable[[], Runs]
Change = Callable[[str, Record], Record]
Table = Callable[[], dict[str, dict[str, np.ndarray]]]


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


def recorded(material: Material = UCM, flows: Sampled = FLOWS, **faults: float) -> Maker:
    """Return the maker of runs at a given rate on one instrument."""

    def make() -> Runs:
        return {
            name: record_of(Instrument(**faults).record(material, *flow))
            for name, flow in flows.items()
        }

    return make


def on_instruments(faults: Mapping[str, Mapping[str, float]], law: RateLaw = GIESEKUS) -> Maker:
    """Return the maker of runs, some of them on instruments with faults, by name."""
    return lambda: {
        name: record_of(Instrument(**faults.get(name, {})).record(law, *flow))
        for name, flow in FLOWS.items()
    }


def batches(fluids: Mapping[str, Material]) -> Maker:
    """Return the maker of runs of a Giesekus fluid, some of them of another, by name."""
    return lambda: {
        name: recorded(fluids.get(name, GIESEKUS), {name: flow})()[name]
        for name, flow in FLOWS.items()
    }


def warmed(factors: Mapping[str, float]) -> Maker:
    """Return the maker of runs at temperatures that drift: a relaxation time for each."""
    return batches({n: replace(GIESEKUS, relaxation_time=LAMBDA * f) for n, f in factors.items()})


def of_plates(names: Sequence[str]) -> Maker:
    """Return the maker of runs of which some come from plates, torque not corrected."""
    return batches({name: PlatePlate(GIESEKUS) for name in names})


def only(name: str, material: Material) -> Maker:
    return recorded(material, {name: FLOWS[name]})


def each(
    change: Change, material: Material = GIESEKUS, flows: Sampled = FLOWS, names=None
) -> Maker:
    """Return the maker of runs that are changed, all or those of some names."""
    return lambda: {
        name: change(name, run) if names is None or name in names else run
        for name, run in recorded(material, flows)().items()
    }


def from_time(make: Maker, begin: float) -> Maker:
    return lambda: {n: run.kept(run.columns["time_s"] >= begin) for n, run in make().items()}


def averaged(width: float, since: bool = False, flows: Sampled = FLOWS) -> Maker:
    """Return the maker of runs told as means over a width in s about each sample, or before it."""

    def make() -> Runs:
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

    return make


def told_otherwise(true: Callable[[str, Flow], Flow], law: RateLaw = GIESEKUS) -> Maker:
    """Return the maker of runs in other flows than are told of them."""

    def make() -> Runs:
        made = {}
        for name, (flow, times) in FLOWS.items():
            run = record_of(Instrument().record(law, true(name, flow), times))
            made[name] = run.told(shear_rate_1_s=np.asarray(flow.rate(times), float) + 0.0 * times)
        return made

    return make


def ramped(rise: float, law: RateLaw) -> Maker:
    """Return the maker of runs whose rate rises evenly over so many s, told as a step."""

    def true(name, flow):
        end = FLOWS[name][1][-1]
        risen = of_rate(lambda t: flow.rate(t) * np.minimum(np.asarray(t) / rise, 1.0), end)
        return replace(risen, jumps=(rise,))

    return told_otherwise(true, law)


def distorted(third: float) -> Maker:
    """Return the maker of runs whose wave has a third harmonic that nobody told."""

    def true(name, flow):
        return flow if name != "wave.csv" else Flow(
            lambda t: flow.rate(t) + third * np.cos(3 * np.asarray(t)),
            lambda t: flow.strain(t) + third * np.sin(3 * np.asarray(t)) / 3,
        )  # fmt: skip

    return told_otherwise(true)


def triggered(late: Mapping[str, float]) -> Maker:
    """Return the maker of runs whose clocks started late, each by so many s."""

    def make() -> Runs:
        made = {}
        for name, (flow, times) in FLOWS.items():
            run = record_of(Instrument().record(GIESEKUS, flow, times + late.get(name, 0.0)))
            made[name] = run.told(time_s=times)
        return made

    return make


def without_rest(rest: float, law: RateLaw = GIESEKUS) -> Maker:
    """Return the maker of runs one after another, with so many s of rest, each from a new zero."""

    def make() -> Runs:
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

    return make


def interpolated_onto(points: int, interval: float = 0.1) -> Maker:
    """Return the maker of start-ups recorded evenly in time, exported evenly in log t by lines."""
    even = {
        name: (flow, np.arange(1, round(times[-1] / interval) + 1) * interval)
        for name, (flow, times) in STARTS.items()
    }

    def make() -> Runs:
        made = {}
        for name, run in recorded(GIESEKUS, even)().items():
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

    return make


def of_blocks(every: int) -> Maker:
    """Return the maker of runs of which so many neighbours each are told as their mean."""
    fine = {
        n: (flow, t[0] / every + np.arange(len(t) * every) * (t[1] - t[0]) / every)
        for n, (flow, t) in FLOWS.items()
    }

    def make() -> Runs:
        made = {}
        for name, run in recorded(GIESEKUS, fine)().items():
            block = {k: v.reshape(-1, every).mean(axis=1) for k, v in run.columns.items()}
            rate = np.asarray(FLOWS[name][0].rate(block["time_s"]), float)
            block["shear_rate_1_s"] = rate + np.zeros(len(block["time_s"]))
            normal = [n.reshape(-1, every).mean(axis=1) for n in (run.N1, run.N2)]
            made[name] = replace(run, columns=block, N1=normal[0], N2=normal[1])
        return made

    return make


def alternating(material: Material, phase: float = 0.7, frequency: float = 1.0) -> Maker:
    """Return the maker of two cycles in steady alternation, which begin at a phase."""
    amplitudes = {"one.csv": 0.7, "two.csv": 1.5, "three.csv": 3.0, "held.csv": 4.0}
    cycle = 2 * np.pi / frequency
    times = np.linspace(0.0, 2 * cycle, 121)

    def make() -> Runs:
        made = {}
        for name, amplitude in amplitudes.items():
            flow = oscillation(amplitude, frequency, phase)
            run = Instrument().record(material, flow, np.append(0.5 * cycle, times + 8 * cycle))
            kept = record_of(run, start="periodic").kept(slice(1, None))
            made[name] = kept.told(time_s=times)
        return made

    return make


def alternations(material: Material, frequency: float, cycles: float) -> Maker:
    """Return the maker of oscillations in steady alternation, taken for such from rest."""
    times = np.linspace(0.0, cycles * 2 * np.pi / frequency, 200)
    strains = {"one.csv": 0.5, "two.csv": 1.0, "three.csv": 2.0, "held.csv": 1.5}
    return lambda: {
        name: record_of(alternation_as_from_rest(material, s * frequency, frequency, times))
        for name, s in strains.items()
    }


def relaxations(*others: str) -> Maker:
    """Return the maker of relaxations after 3 and 6 % strain, told as runs, and some sound ones."""

    def make() -> Runs:
        times = np.geomspace(0.01, 5.0, 100)
        runs = {n: r for n, r in recorded(UCM, BAD_DAYS)().items() if n in others}
        both = Modes(UCM, UpperConvectedMaxwell(60.0, 0.1))
        for name, strain in (("step.csv", 0.03), ("step2.csv", 0.06)):
            # its strain is there within the first samples, as an instrument records it
            run = record_of(relaxation_as_run(both, strain, 0.02, times))
            ramp, rate = strain * -np.expm1(-times / 0.02), strain / 0.02 * np.exp(-times / 0.02)
            runs[name] = run.told(shear_rate_1_s=rate, strain=ramp)
        return runs

    return make


def absent(level: float, names: Sequence[str] = tuple(BAD_DAYS)) -> Maker:
    """Return the maker of runs of which some are a constant stress and no fluid."""

    def make() -> Runs:
        return {
            name: record_of(nothing(run, level) if name in names else run)
            for name, flow in BAD_DAYS.items()
            for run in [Instrument().record(UCM, *flow)]
        }

    return make


def swapped() -> Runs:
    """Return runs with the stresses of two of them exchanged."""
    runs = recorded(GIESEKUS, BAD_DAYS)()
    slow, fast = runs["slow.csv"], runs["fast.csv"]
    runs["slow.csv"] = slow.told(stress_Pa=fast.columns["stress_Pa"])
    runs["fast.csv"] = fast.told(stress_Pa=slow.columns["stress_Pa"])
    return runs


def creeping(law: RateLaw, solvent: float = 5.0) -> Maker:
    """Return the maker of creep and recovery at four stresses."""
    times = np.append(np.geomspace(0.02, 8.0, 50), 8.0 + np.geomspace(0.02, 8.0, 40))
    stresses = {"a.csv": 30.0, "b.csv": 60.0, "c.csv": 90.0, "held.csv": 120.0}

    def make() -> Runs:
        made = {}
        for name, stress in stresses.items():
            strain = strain_at(law, [(0.0, stress), (8.0, 0.0)], solvent, times)
            made[name] = _crept(times, np.where(times <= 8.0, stress, 0.0), strain)
        return made

    return make


def _crept(times: np.ndarray, stress: np.ndarray, strain: np.ndarray) -> Record:
    columns = {"time_s": times, "stress_Pa": stress, "strain": strain}
    return Record(columns, "strain", {"control": "stress"})


def ringing_creep(law: RateLaw, inertia: float, solvent: float = 2.0) -> Maker:
    """Return the maker of creep with the inertia of a tool: I γ'' = σ − what the fluid carries."""
    times = np.geomspace(0.02, 12.0, 90)
    stresses = {"a.csv": 30.0, "b.csv": 60.0, "c.csv": 90.0, "held.csv": 75.0}
    scale = np.append(law.scale(), [1.0, 1.0])

    def make() -> Runs:
        made = {}
        for name, imposed in stresses.items():

            def change(t, scaled, imposed=imposed):
                state = scale * scaled
                rate = state[-1]
                carried = law.stress(state[:-2], rate)[0, 1] + solvent * rate
                grown = (imposed - carried) / inertia
                return np.concatenate([law.change(state[:-2], rate), [rate, grown]]) / scale

            start = np.concatenate([law.rest(), [0.0, 0.0]]) / scale
            found = solve_ivp(
                change, (0.0, times[-1]), start, "LSODA", times, rtol=1e-9, atol=1e-10
            )
            made[name] = _crept(times, np.full(len(times), imposed), found.y[-2])
        return made

    return make


_PULLED = {"a.csv": 0.2, "b.csv": 0.6, "c.csv": 2.0, "held.csv": 1.2}


def _pulled_record(times: np.ndarray, rate: float, stress: np.ndarray) -> Record:
    columns = {"time_s": times, "hencky_rate_1_s": np.full(len(times), rate)}
    columns["tensile_stress_Pa"] = stress
    return Record(columns, "tensile_stress_Pa", {"flow": "uniaxial"})


def pulled(law: RateLaw, over_first_area: bool = False) -> Maker:
    """Return the maker of uniaxial extensions, the stress told as it is or over the first area."""

    def make() -> Runs:
        made = {}
        for name, rate in _PULLED.items():
            times = np.linspace(0.03, 3.0 / rate, 80) if rate > 0.3 else np.linspace(0.1, 12.0, 80)
            stress = law.pull(rate, times) * (np.exp(-rate * times) if over_first_area else 1.0)
            made[name] = _pulled_record(times, rate, stress)
        return made

    return make


def stretched_otherwise(law: RateLaw, rate_at, shape: Sequence[float], told) -> Maker:
    """Return the maker of extensions of a rate that varies, and of a shape, told as uniaxial."""

    def make() -> Runs:
        made = {}
        for name, rate in _PULLED.items():
            times = np.linspace(0.03, 3.0 / rate, 80)

            def change(t, s, rate=rate):
                return law.change(s, rate_at(rate, t) * np.diag(shape))

            states = integrate(change, law.rest(), times, scale=law.scale())
            tensors = [law.stress(s, np.zeros((3, 3))) for s in states]
            stress = np.array([one[0, 0] - one[1, 1] for one in tensors])
            made[name] = _pulled_record(times, rate, told(stress, rate, times))
        return made

    return make


def necked(law: RateLaw, begins: float = 1.5, more: float = 0.6) -> Maker:
    """Return extensions that neck, the force told over the area of a sample without a neck."""
    return stretched_otherwise(
        law,
        lambda rate, t: rate * (1 + more * max(rate * t - begins, 0.0)),
        [1.0, -0.5, -0.5],
        lambda stress, rate, times: (
            stress * np.exp(-(0.5 * more * np.maximum(rate * times - begins, 0.0) ** 2))
        ),
    )


def planar_told_uniaxial(law: RateLaw) -> Maker:
    return stretched_otherwise(law, lambda rate, t: rate, [1.0, -1.0, 0.0], lambda s, r, t: s)


def then_sheared(law: RateLaw, rate: float = 1.0) -> Maker:
    """Return the maker of uniaxial extensions, with a start-up in shear held out."""

    def make() -> Runs:
        made = pulled(law)()
        made["d.csv"] = made.pop("held.csv")
        (sheared,) = recorded(law, {"held.csv": (start_up(rate), _GROWTH)})().values()
        return {**made, "held.csv": replace(sheared, cells={"flow": "shear"})}

    return make


def _after(material: Material, flow: Flow, begin: float, after: np.ndarray, **cells) -> Record:
    """Return the record of a flow from a time on, which is its zero."""
    run = record_of(Instrument().record(material, flow, begin + after), **cells)
    return run.told(time_s=after)


def relaxing(material: Material, takes: float = 0.02) -> Maker:
    """Return the maker of relaxations after steps of strain, each put on in a declared time."""
    strains = {"a.csv": 0.5, "b.csv": 1.5, "c.csv": 3.0, "held.csv": 2.0}
    after = np.geomspace(0.02, 6.0, 60)
    return lambda: {
        name: _after(material, step_strain(strain, takes), takes, after,
                     step_strain=strain, step_time_s=takes)
        for name, strain in strains.items()
    }  # fmt: skip


def stopped(material: Material, then: Mapping[str, float] = {}) -> Maker:
    """Return the maker of stresses after a steady flow has stopped, and of start-ups beside."""
    rates = {"a.csv": 0.5, "b.csv": 1.0, "c.csv": 3.0, "d.csv" if then else "held.csv": 2.0}
    after, lasted = np.linspace(0.0, 5.0, 80), 25.0

    def make() -> Runs:
        made = {
            name: _after(material, steps([0.0, lasted], [rate, 0.0]), lasted, after,
                         start="steady", rate_before_1_s=rate)
            for name, rate in rates.items()
        }  # fmt: skip
        starts = {name: (start_up(rate), _GROWTH) for name, rate in then.items()}
        return made | recorded(material, starts)()

    return make


def strains(put_on: float) -> Maker:
    """Return the maker of steps of strain, told as at once and dated from their beginning."""
    times = np.geomspace(1.5 * put_on, 5.0, 60)

    def make() -> Runs:
        made = {}
        for name, size in {"a.csv": 0.5, "b.csv": 1.5, "c.csv": 4.0, "held.csv": 3.0}.items():
            run = record_of(
                Instrument().record(GIESEKUS, step_strain(size, put_on), times), step_strain=size
            )
            made[name] = run.told(shear_rate_1_s=np.zeros(len(times)))
        return made

    return make
