"""Records of the hostile data sets: runs and tables by scipy, without noise."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from hostile_fluids_materials import (
    white,
)
from independent import (
    Giesekus,
    PomPom,
    UpperConvectedMaxwell,
    oscillation,
    start_up,
)
from independent.flow import Flow
from independent.sweeps import strain_at
from independent.instruments import Instrument
from independent.material import Material, RateLaw
from independent.named import material as named
from independent.sweeps import modulus_of

G, LAMBDA = 100.0, 1.0
SCALE = {"modulus": G, "relaxation_time": LAMBDA}
UCM = UpperConvectedMaxwell(**SCALE)
GIESEKUS = Giesekus(0.3, **SCALE)
POM_POM = PomPom(5.0, 0.4, **SCALE)
SARAMITO = named("saramito", {"yield_strain": 0.4}, G, LAMBDA)
KNOWN = {"law": "ucm", "modulus_Pa": G, "relaxation_time_s": LAMBDA}
FITTED = {"law": "ucm", "modulus_Pa": "fit", "relaxation_time_s": "fit"}
MOBILITY = {"giesekus_mobility": {"alpha": 0.3}}
SQUARE = {"sigma.sigma": 0.3}
DAMPED = {"strain_damping": {"n": 0.25}}
"""Effects of the K-BKZ fluids: all that there is where no flow turns, near it where one does."""
_GROWTH, _WAVE = np.linspace(0.1, 8.0, 80), np.linspace(0.1, 12.0, 120)
Sampled = dict[str, tuple[Flow, np.ndarray]]
FLOWS: Sampled = {
    "slow.csv": (start_up(0.5), _GROWTH),
    "fast.csv": (start_up(2.0), _GROWTH),
    "wave.csv": (oscillation(2.0, 1.0), _WAVE),
    "held.csv": (start_up(3.0), _GROWTH),
}
Noise = Callable[[np.ndarray, np.random.Generator], np.ndarray]


@dataclass(frozen=True)
class Record:
    """One run without noise.

    Attributes
    ----------
    columns
        Of the file, by name.
    observed
        Name of the column that gets the noise.
    cells
        Of the table of runs.
    N1, N2
        Of the fluid, in Pa; None where nobody knows them.
    """

    columns: dict[str, np.ndarray]
    observed: str = "stress_Pa"
    cells: Mapping[str, Any] = field(default_factory=dict)
    N1: np.ndarray | None = None
    N2: np.ndarray | None = None


@dataclass(frozen=True)
class Case:
    """One data set, what is declared of it, and what is true.

    Attributes
    ----------
    truth
        In words.
    records
        Makes the runs without noise.
    noise
        Put on what is observed.
    planted
        Effects that are there, with constants that are known.
    same_as
        Names that are no falsehood: they come to the same here, or describe the same thing.
    terms
        Of the library, that are all that is missing; None where the library does not hold it.
    outside
        Whether no effect describes what is there.
    fluid
        Whether there is one.
    tables
        Makes tables beside the runs, by file name, without noise; each is fitted.
    model
        Section of the study, for both commands.
    told
        Further entries of the study's section of data.
    export
        What becomes of the runs once they have their noise.
    """

    truth: str
    records: Callable[[], dict[str, Record]]
    noise: Noise = field(default_factory=lambda: white(0.01))
    planted: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    same_as: tuple[str, ...] = ()
    terms: Mapping[str, float] | None = None
    outside: bool = False
    fluid: bool = True
    tables: Callable[[], dict[str, dict[str, np.ndarray]]] | None = None
    model: Mapping[str, Any] = field(default_factory=lambda: dict(KNOWN))
    held_out: tuple[str, ...] = ("held.csv",)
    told: Mapping[str, Any] = field(default_factory=dict)
    export: Callable[[dict[str, Record]], dict[str, Record]] | None = None


@dataclass(frozen=True)
class _Strange:
    truth: str
    fluid: Material
    same_as: tuple[str, ...] = ()
    planted: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


def recorded(material: Material = UCM, flows: Sampled = FLOWS, **faults):
    """Return the maker of runs at a given rate on one instrument."""
    instrument = Instrument(**faults)

    def make() -> dict[str, Record]:
        runs = {name: instrument.record(material, *flow) for name, flow in flows.items()}
        return {name: _record(run) for name, run in runs.items()}

    return make


def _record(run, **cells) -> Record:
    columns = {"time_s": run.time, "shear_rate_1_s": run.rate, "stress_Pa": run.stress}
    known = np.all(np.isfinite(run.true.N1))
    normal = (run.true.N1, run.true.N2) if known else (None, None)
    return Record(columns, cells=cells, N1=normal[0], N2=normal[1])


def changed(change: Callable[[Record], Record], material=UCM, names=tuple(FLOWS), flows=FLOWS):
    """Return the maker of runs with some of the records changed."""

    def make() -> dict[str, Record]:
        runs = recorded(material, flows)()
        return {name: change(run) if name in names else run for name, run in runs.items()}

    return make


def stress_of(function: Callable[[dict[str, np.ndarray]], np.ndarray], silent: bool = False):
    """Return the change of a record's stress; with `silent` no fluid is in it."""

    def change(record: Record) -> Record:
        columns = {**record.columns, "stress_Pa": function(record.columns)}
        if silent:
            return replace(record, columns=columns, N1=None, N2=None)
        return replace(record, columns=columns)

    return change


def fractured(columns: dict[str, np.ndarray]) -> np.ndarray:
    """Return the stress behind an edge that loses a third of its area over a strain of 1."""
    time, rate = columns["time_s"], np.abs(columns["shear_rate_1_s"])
    strain = np.concatenate(
        [
            [rate[0] * time[0]],
            rate[0] * time[0] + np.cumsum((rate[1:] + rate[:-1]) / 2 * np.diff(time)),
        ]
    )
    return columns["stress_Pa"] * (1 - 0.33 / (1 + np.exp(-(strain - 5.0) / 0.4)))


def late(begin: float) -> Sampled:
    """Return the flows, recorded from a time after their start."""
    return {name: (flow, times[times >= begin]) for name, (flow, times) in FLOWS.items()}


def later_zero(begin: float):
    """Return the change of a record whose clock was started after the flow."""

    def change(record: Record) -> Record:
        kept = record.columns["time_s"] > begin
        columns = {name: values[kept] for name, values in record.columns.items()}
        columns["time_s"] = columns["time_s"] - begin
        normal = None if record.N1 is None else record.N1[kept]
        second = None if record.N2 is None else record.N2[kept]
        return replace(record, columns=columns, N1=normal, N2=second)

    return change


_LOT = np.random.default_rng(7)
FEW: Sampled = {
    "a.csv": (start_up(0.5), np.linspace(0.3, 6.0, 8)),
    "b.csv": (start_up(1.0), np.linspace(0.3, 6.0, 8)),
    "c.csv": (start_up(2.0), np.linspace(0.3, 6.0, 8)),
    "d.csv": (start_up(4.0), np.linspace(0.3, 6.0, 8)),
    "held.csv": (start_up(3.0), np.linspace(0.3, 6.0, 8)),
}
UNEQUAL: Sampled = {
    "short.csv": (start_up(4.0), np.linspace(0.05, 1.0, 12)),
    "long.csv": (start_up(0.3), np.linspace(0.2, 60.0, 300)),
    "wave.csv": (oscillation(2.0, 1.0), np.linspace(0.1, 6.0, 40)),
    "held.csv": (start_up(2.0), np.linspace(0.1, 8.0, 60)),
}
UNEVEN: Sampled = {
    name: (flow, np.sort(_LOT.uniform(0.02, times[-1], len(times))))
    for name, (flow, times) in FLOWS.items()
}
SLOW: Sampled = {
    "a.csv": (start_up(0.02), np.linspace(0.1, 8.0, 80)),
    "b.csv": (start_up(0.02), np.geomspace(0.1, 20.0, 80)),
    "c.csv": (oscillation(0.02, 0.5), np.linspace(0.1, 25.0, 120)),
    "held.csv": (start_up(2.0), _GROWTH),
}
SLOW_ALONE = {name: flow for name, flow in SLOW.items() if name != "held.csv"}
ALL: Sampled = {name: flow for name, flow in FLOWS.items() if name != "held.csv"}
TWO: Sampled = {name: FLOWS[name] for name in ("slow.csv", "fast.csv")}
ONE: Sampled = {"only.csv": (start_up(2.0), _GROWTH)}
ONE_HELD: Sampled = {**ONE, "held.csv": FLOWS["held.csv"]}


def alternating(material: Material, phase: float = 0.7, frequency: float = 1.0):
    """Return the maker of two cycles in steady alternation, which begin at a phase."""
    amplitudes = {"one.csv": 0.7, "two.csv": 1.5, "three.csv": 3.0, "held.csv": 4.0}
    cycle = 2 * np.pi / frequency
    times = np.linspace(0.0, 2 * cycle, 121)

    def make() -> dict[str, Record]:
        made = {}
        for name, amplitude in amplitudes.items():
            flow = oscillation(amplitude, frequency, phase)
            run = _record(
                Instrument().record(material, flow, np.append(0.5 * cycle, times + 8 * cycle)),
                start="periodic",
            )
            columns = {key: values[1:] for key, values in run.columns.items()}
            columns["time_s"] = times
            normal = None if run.N1 is None else (run.N1[1:], run.N2[1:])
            made[name] = replace(
                run, columns=columns, N1=None if normal is None else normal[0],
                N2=None if normal is None else normal[1],
            )  # fmt: skip
        return made

    return make


def creeping(law: RateLaw, solvent: float = 5.0):
    """Return the maker of creep and recovery at four stresses."""
    times = np.append(np.geomspace(0.02, 8.0, 50), 8.0 + np.geomspace(0.02, 8.0, 40))
    stresses = {"a.csv": 30.0, "b.csv": 60.0, "c.csv": 90.0, "held.csv": 120.0}

    def make() -> dict[str, Record]:
        made = {}
        for name, stress in stresses.items():
            strain = strain_at(law, [(0.0, stress), (8.0, 0.0)], solvent, times)
            applied = np.where(times <= 8.0, stress, 0.0)
            columns = {"time_s": times, "stress_Pa": applied, "strain": strain}
            made[name] = Record(columns, "strain", {"control": "stress"})
        return made

    return make


def swept(law: RateLaw):
    """Return the maker of an amplitude sweep at 1 rad/s."""

    def make() -> dict[str, dict[str, np.ndarray]]:
        strains = np.geomspace(0.05, 6.0, 20)
        found = np.array([modulus_of(law, strain, 1.0, 6) for strain in strains])
        columns = {"strain": strains, "omega_rad_s": np.ones(20)}
        return {"amplitude_sweep.csv": {**columns, "Gp_Pa": found.real, "Gpp_Pa": found.imag}}

    return make


def curve(material: Material):
    """Return the maker of a flow curve."""

    def make() -> dict[str, dict[str, np.ndarray]]:
        rates = np.geomspace(0.05, 20.0, 30)
        ends = np.array([30.0, 60.0])
        stress = [material.respond(start_up(r), ends).sigma12[-1] for r in rates]
        return {"flow_curve.csv": {"shear_rate_1_s": rates, "stress_Pa": np.array(stress)}}

    return make


def only(name: str, material: Material):
    return recorded(material, {name: FLOWS[name]})


def wrong(**constants) -> dict[str, Any]:
    return {**KNOWN, **constants}
