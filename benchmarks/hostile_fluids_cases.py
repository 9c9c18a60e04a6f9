"""What an evaluator might hand over, and what is true of it. Rules are in `hostile_fluids.py`."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from hostile_fluids_materials import (
    Elastoplastic,
    Heated,
    Inelastic,
    Rubber,
    autoregressive,
    fractional,
    heavy,
    level,
    proportional,
    steps_of,
    walk_alone,
    wandering,
    white,
    with_strays,
)
from independent import (
    KBKZ,
    Giesekus,
    Modes,
    Newtonian,
    PhanThienTanner,
    PomPom,
    RoliePoly,
    UpperConvectedMaxwell,
    WhiteMetzner,
    oscillation,
    start_up,
)
from independent.flow import Flow
from independent.imposed_stress import strain_at
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


@dataclass(frozen=True)
class _Strange:
    truth: str
    fluid: Material
    same_as: tuple[str, ...] = ()


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


_SHEAR = {"planted": MOBILITY, "terms": SQUARE}
EMPTY = {
    "correlated_noise_alone": Case(
        "no fluid, AR(1) noise 0.9 of 20 Pa", changed(stress_of(lambda c: 0 * c["time_s"], True)),
        autoregressive(20.0, 0.9, True), fluid=False,
    ),
    "walk_alone": Case(
        "no fluid, a random walk", changed(stress_of(lambda c: 0 * c["time_s"], True)),
        walk_alone(3.0), fluid=False,
    ),
    "hum_alone": Case(
        "no fluid, a hum of 1.3 Hz",
        changed(stress_of(lambda c: 30 * np.sin(2 * np.pi * 1.3 * c["time_s"]), True)),
        level(2.0), fluid=False,
    ),
    "ramp_alone": Case(
        "no fluid, a zero that drifts",
        changed(stress_of(lambda c: 10 + 4 * c["time_s"], True)), level(2.0), fluid=False,
        same_as=("stress_drift", "stress_offset"),
    ),
    "sign_of_all": Case(
        "Giesekus, every stress negative", changed(stress_of(lambda c: -c["stress_Pa"]), GIESEKUS),
        outside=True,
    ),
    "sign_of_held_out": Case(
        "Giesekus, the stress held out negative",
        changed(stress_of(lambda c: -c["stress_Pa"]), GIESEKUS, ("held.csv",)), outside=True,
    ),
    "baseline": Case(
        "Giesekus and 15 Pa", changed(stress_of(lambda c: 15 + c["stress_Pa"]), GIESEKUS),
        planted={**MOBILITY, "stress_offset": {"offset": 15.0}},
    ),
}  # fmt: skip
NOISY = {
    "proportional": Case("Giesekus, 5 % of each value", recorded(GIESEKUS), proportional(0.05),
                         **_SHEAR),
    "correlated": Case("Giesekus, AR(1) noise 2 %, 0.9", recorded(GIESEKUS),
                       autoregressive(0.02, 0.9), **_SHEAR),
    "quantised": Case("Giesekus, steps of 4 % of the largest", recorded(GIESEKUS), steps_of(0.04),
                      **_SHEAR),
    "outliers": Case("Giesekus, 2 % outliers", recorded(GIESEKUS), with_strays(0.02), **_SHEAR),
    "heavy_tails": Case("Giesekus, Student's noise", recorded(GIESEKUS), heavy(0.01), **_SHEAR),
    "wandering_zero": Case("Giesekus, a random walk of 4 %", recorded(GIESEKUS), wandering(0.04),
                           **_SHEAR),
    "proportional_ucm": Case("Maxwell, 5 % of each value", recorded(), proportional(0.05), terms={}),
    "quantised_ucm": Case("Maxwell, steps of 4 %", recorded(), steps_of(0.04), terms={}),
    "wandering_ucm": Case("Maxwell, a random walk of 4 %", recorded(), wandering(0.04), terms={}),
    "correlated_ucm": Case("Maxwell, AR(1) noise 2 %, 0.95", recorded(),
                           autoregressive(0.02, 0.95), terms={}),
    "heavy_tails_ucm": Case("Maxwell, Student's noise", recorded(), heavy(0.01), terms={}),
}  # fmt: skip
_GAINS = ("stress_gain", "rate_gain", "modulus_Pa", "relaxation_time_factor")
_TIMES = ("relaxation_time_factor", "relaxation_time_s", "wall_slip", "sigma", "tool_compliance")
DECLARED = {
    "modulus_high": Case("Giesekus, modulus told 10 % high", recorded(GIESEKUS),
                         planted=MOBILITY, model=wrong(modulus_Pa=110.0), same_as=_GAINS),
    "time_high": Case("Giesekus, time told 10 % high", recorded(GIESEKUS), planted=MOBILITY,
                      model=wrong(relaxation_time_s=1.1), same_as=_TIMES),
    "solvent_told": Case(
        "Giesekus, a solvent told that is not there", recorded(GIESEKUS), planted=MOBILITY,
        model=wrong(solvent_viscosity_Pa_s=5.0), same_as=("solvent_viscosity", "gammadot"),
        outside=True,
    ),
    "solvent_not_told": Case(
        "Giesekus and 5 Pa s of solvent", recorded(Modes(GIESEKUS, Newtonian(5.0))),
        planted={**MOBILITY, "solvent_viscosity": {}},
    ),
    "time_high_ucm": Case("Maxwell, time told 10 % high", recorded(),
                          model=wrong(relaxation_time_s=1.1), same_as=_TIMES),
    "constants_fitted": Case("Giesekus, modulus and time fitted", recorded(GIESEKUS), model=FITTED,
                             **_SHEAR),
    "constants_fitted_ucm": Case("Maxwell, modulus and time fitted", recorded(), model=FITTED,
                                 terms={}),
    "law_fitted": Case(
        "Giesekus told, its mobility fitted", recorded(GIESEKUS), terms={},
        model={**KNOWN, "law": "giesekus", "parameters": {"alpha": "fit"}},
    ),
    "law_and_constants_fitted": Case(
        "Giesekus told, all fitted", recorded(GIESEKUS), terms={},
        model={**FITTED, "law": "giesekus", "parameters": {"alpha": "fit"}},
    ),
    "wrong_law": Case(
        "linear PTT told as Giesekus", recorded(PhanThienTanner(0.3, "linear", **SCALE)),
        model={**KNOWN, "law": "giesekus", "parameters": {"alpha": "fit"}},
        same_as=("ptt_linear", "tr(sigma)*sigma"), terms=None,
    ),
}  # fmt: skip
FLUIDS = {
    "saramito": Case("Saramito, a yield stress", recorded(SARAMITO),
                     planted={"yield_stress": {"yield_strain": 0.4}}),
    "k_bkz": Case("K-BKZ", recorded(KBKZ(0.25, **SCALE)), outside=True),
    "elastoplastic": Case("Hébraud–Lequeux", recorded(Elastoplastic()), outside=True),
    "elastoplastic_fitted": Case("Hébraud–Lequeux", recorded(Elastoplastic()), outside=True,
                                 model=FITTED),
    "fractional": Case("fractional Maxwell, told as one mode", recorded(fractional()),
                       outside=True, same_as=("relaxation_mode",)),
    "fractional_fitted": Case("fractional Maxwell, one mode fitted", recorded(fractional()),
                              outside=True, model=FITTED, same_as=("relaxation_mode",)),
    "two_modes": Case(
        "two modes told as one", recorded(Modes(UCM, UpperConvectedMaxwell(60.0, 0.2))),
        planted={"relaxation_mode": {"G": 60.0, "lambda": 0.2}}, outside=True, model=FITTED,
    ),
    "power_law": Case("inelastic, power law", recorded(Inelastic()), outside=True, model=FITTED),
    "herschel_bulkley": Case("inelastic, yields", recorded(Inelastic(40.0, 0.6, 60.0)),
                             outside=True, model=FITTED),
    "rubber": Case("no fluid: a rubber", recorded(Rubber()), outside=True, model=FITTED),
    "rubber_told": Case("no fluid: a rubber", recorded(Rubber()), outside=True),
}  # fmt: skip
_HEAT = ("viscous_heating",)
FAULTS = {
    "power_slip_ucm": Case("Maxwell, slip with σ²", recorded(slip=2e-5, slip_power=2.0),
                           outside=True, same_as=("wall_slip",)),
    "power_slip_giesekus": Case("Giesekus, slip with σ³",
                                recorded(GIESEKUS, slip=3e-7, slip_power=3.0), outside=True,
                                same_as=("wall_slip", "giesekus_mobility")),
    "fracture_ucm": Case("Maxwell, an edge that breaks", changed(stress_of(fractured)),
                         outside=True, same_as=("edge_fracture",)),
    "fracture_giesekus": Case("Giesekus, an edge that breaks",
                              changed(stress_of(fractured), GIESEKUS), outside=True,
                              same_as=("edge_fracture", "giesekus_mobility")),
    "heated_ucm": Case("Maxwell that warms", recorded(Heated()), outside=True, same_as=_HEAT),
    "heated_giesekus": Case("Giesekus that warms", recorded(Heated(0.3)), outside=True,
                            same_as=(*_HEAT, "giesekus_mobility")),
    "drift_giesekus": Case("Giesekus, 2 Pa/s of drift", recorded(GIESEKUS, drift=2.0),
                           planted={**MOBILITY, "stress_drift": {"drift": 2.0}}),
    "ringing_ucm": Case("Maxwell, a transducer that rings", recorded(resonance=12.0, damping=0.15),
                        outside=True),
    "ringing_giesekus": Case("Giesekus, a transducer that rings",
                             recorded(GIESEKUS, resonance=12.0, damping=0.15), outside=True,
                             same_as=("giesekus_mobility",)),
}  # fmt: skip
SAMPLING = {
    "unequal": Case("Giesekus, runs of 12 to 300 samples", recorded(GIESEKUS, UNEQUAL), **_SHEAR),
    "few_samples": Case("Giesekus, 8 samples a run", recorded(GIESEKUS, FEW), **_SHEAR),
    "few_samples_pom_pom": Case("pom-pom, 8 samples a run", recorded(POM_POM, FEW), outside=True),
    "few_samples_ucm": Case("Maxwell, 8 samples a run", recorded(UCM, FEW), terms={}),
    "uneven": Case("Giesekus, times at random", recorded(GIESEKUS, UNEVEN), **_SHEAR),
    "begins_late": Case("Giesekus, recorded from 0.8 s on", recorded(GIESEKUS, late(0.8)), **_SHEAR),
    "clock_late": Case("Giesekus, clock 0.4 s late", changed(later_zero(0.4), GIESEKUS),
                       outside=True, same_as=("giesekus_mobility",)),
    "clock_late_ucm": Case("Maxwell, clock 0.4 s late", changed(later_zero(0.4)), outside=True),
    "slow_alone": Case("Giesekus, all runs slow, none held out", recorded(GIESEKUS, SLOW_ALONE),
                       terms=SQUARE, held_out=(), planted=MOBILITY),
    "slow_then_fast": Case("Giesekus, fitted runs slow", recorded(GIESEKUS, SLOW), terms=SQUARE,
                           planted=MOBILITY),
    "slow_pom_pom": Case("pom-pom, fitted runs slow", recorded(POM_POM, SLOW), outside=True),
    "one_run": Case("Giesekus, one start-up", recorded(GIESEKUS, ONE), held_out=(), **_SHEAR),
    "one_run_pom_pom": Case("pom-pom, one start-up", recorded(POM_POM, ONE), held_out=(),
                            outside=True),
    "one_run_pom_pom_held": Case("pom-pom, one start-up fitted", recorded(POM_POM, ONE_HELD),
                                 outside=True),
    "one_run_k_bkz": Case("K-BKZ, one start-up", recorded(KBKZ(0.25, **SCALE), ONE), held_out=(),
                          outside=True),
    "one_run_fractional": Case("fractional Maxwell, one start-up, constants fitted",
                               recorded(fractional(), ONE), held_out=(), outside=True,
                               model=FITTED, same_as=("relaxation_mode",)),
    "one_run_ucm_fitted": Case("Maxwell, one start-up, constants fitted", recorded(UCM, ONE),
                               held_out=(), model=FITTED, terms={}),
}  # fmt: skip
NONE_HELD = {
    f"{which}_{name}": Case(
        f"{material.truth}, {which} runs, none held out", recorded(material.fluid, flows),
        outside=True, same_as=material.same_as, held_out=(),
    )
    for which, flows in (("three", ALL), ("two", TWO))
    for name, material in {
        "pom_pom": _Strange("pom-pom", POM_POM),
        "k_bkz": _Strange("K-BKZ", KBKZ(0.25, **SCALE)),
        "elastoplastic": _Strange("Hébraud–Lequeux", Elastoplastic()),
        "white_metzner": _Strange("White–Metzner", WhiteMetzner(0.5, **SCALE)),
        "heated": _Strange("Maxwell that warms", Heated(), ("viscous_heating",)),
    }.items()
}  # fmt: skip
_CREEP = {"model": wrong(solvent_viscosity_Pa_s=5.0)}
TESTS = {
    "alternation_giesekus": Case("Giesekus in steady alternation, at a phase",
                                 alternating(GIESEKUS), **_SHEAR),
    "alternation_pom_pom": Case("pom-pom in steady alternation, at a phase", alternating(POM_POM),
                                outside=True),
    "alternation_k_bkz": Case("K-BKZ in steady alternation", alternating(KBKZ(0.25, **SCALE)),
                              outside=True),
    "alternation_saramito": Case("Saramito in steady alternation", alternating(SARAMITO),
                                 planted={"yield_stress": {"yield_strain": 0.4}}),
    "creep_pom_pom": Case("pom-pom in creep", creeping(POM_POM), outside=True, **_CREEP),
    "creep_saramito": Case("Saramito in creep", creeping(SARAMITO),
                           planted={"yield_stress": {"yield_strain": 0.4}}, **_CREEP),
    "creep_rolie_poly": Case("Rolie–Poly with stretch in creep",
                             creeping(RoliePoly(1.0, 0.1, **SCALE)), outside=True,
                             same_as=("convective_constraint_release",), **_CREEP),
    "sweep_pom_pom": Case("pom-pom in an amplitude sweep", only("held.csv", POM_POM), outside=True,
                          tables=swept(POM_POM)),
    "sweep_saramito": Case("Saramito in an amplitude sweep", only("held.csv", SARAMITO),
                           planted={"yield_stress": {"yield_strain": 0.4}},
                           tables=swept(SARAMITO)),
    "curve_white_metzner": Case("White–Metzner, a flow curve",
                                only("held.csv", WhiteMetzner(0.5, **SCALE)), outside=True,
                                tables=curve(WhiteMetzner(0.5, **SCALE))),
    "curve_k_bkz": Case("K-BKZ, a flow curve", only("held.csv", KBKZ(0.25, **SCALE)), outside=True,
                        tables=curve(KBKZ(0.25, **SCALE))),
}  # fmt: skip

CASES: dict[str, Case] = {
    **EMPTY, **FLUIDS, **FAULTS, **SAMPLING, **NONE_HELD, **TESTS, **DECLARED, **NOISY
}  # fmt: skip
