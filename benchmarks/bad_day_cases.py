"""Sixty records with bad days, and what is true of each. See `bad_days.py` for the rules."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from independent import (
    KBKZ,
    ExtendedPomPom,
    FenePeterlin,
    Giesekus,
    JohnsonSegalman,
    Modes,
    Newtonian,
    PhanThienTanner,
    PomPom,
    RoliePoly,
    Thixotropic,
    UpperConvectedMaxwell,
    WhiteMetzner,
    multimode_giesekus,
    oscillation,
    start_up,
)
from independent import noise as noises
from independent.flow import Flow
from independent.folders import maxwell_sweep
from independent.instruments import Instrument, Recording
from independent.material import Material
from independent.instruments import alternation_as_from_rest, nothing, relaxation_as_run, scaled

G, LAMBDA = 100.0, 1.0
SCALE = {"modulus": G, "relaxation_time": LAMBDA}
UCM = UpperConvectedMaxwell(**SCALE)
_GROWTH, _WAVE = np.geomspace(0.05, 10.0, 60), np.linspace(0.0, 12.0, 121)
FLOWS: dict[str, tuple[Flow, np.ndarray]] = {
    "slow.csv": (start_up(0.5), _GROWTH),
    "fast.csv": (start_up(2.0), _GROWTH),
    "wave.csv": (oscillation(2.0, 1.0), _WAVE),
    "held.csv": (start_up(3.0), _GROWTH),
}
Runs = dict[str, Recording]
Noise = Callable[[np.ndarray, np.random.Generator], np.ndarray]


def white(size: float) -> Noise:
    return lambda stress, generator: noises.white(stress, size, generator)


@dataclass(frozen=True)
class Case:
    """One record, what was declared of it, and what is true.

    Attributes
    ----------
    truth
        In words.
    runs
        Makes the record without noise, faults included; run names end in ``.csv``.
    noise
        Put on the stress of each run.
    planted
        Effects of the dictionary that are there, with constants that are known.
    outside
        Whether something is there that no effect and no term of the library describes.
    signal
        Whether there is a fluid in the record at all.
    same_as
        Effects that come to the same in these flows, or are the dictionary's nearest description;
        to name one is no falsehood.
    model, loop
        Sections of the study.
    compare
        ``[model]`` of the comparison, or None where there is none.
    library
        Whether the law that `compare` looks for is in its library.
    modes
        Moduli and relaxation times in ``lve.csv``.
    """

    truth: str
    runs: Callable[[], Runs]
    noise: Noise = field(default_factory=lambda: white(0.01))
    planted: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    outside: bool = False
    signal: bool = True
    same_as: tuple[str, ...] = ()
    model: Mapping[str, Any] = field(default_factory=dict)
    loop: Mapping[str, Any] = field(default_factory=dict)
    compare: Mapping[str, Any] | None = None
    library: bool = False
    modes: tuple[list[float], list[float]] | None = None
    held_out: tuple[str, ...] = ("held.csv",)

    def sweep(self) -> dict[str, np.ndarray] | None:
        """Return the columns of ``lve.csv``, if there is one."""
        if self.modes is None:
            return None
        moduli, times = map(np.array, self.modes)
        return maxwell_sweep(moduli, times, np.geomspace(0.01, 100.0, 25))


KNOWN = {"law": "ucm", "modulus_Pa": G, "relaxation_time_s": LAMBDA}
FITTED = {"law": "ucm", "modulus_Pa": "fit", "relaxation_time_s": "fit"}


def known(law: str, **parameters) -> dict[str, Any]:
    return {**KNOWN, "law": law, "parameters": parameters}


def fitted(law: str, **parameters) -> dict[str, Any]:
    return {**FITTED, "law": law, "parameters": parameters}


def recorded(material: Material = UCM, **faults) -> Callable[[], Runs]:
    """Return the maker of the four flows on one instrument."""
    instrument = Instrument(**faults)
    return lambda: {name: instrument.record(material, *flow) for name, flow in FLOWS.items()}


def changed(names: tuple[str, ...], change: Callable[[Recording], Recording], material=UCM):
    """Return the maker of the four flows with some of the records changed."""

    def make() -> Runs:
        runs = recorded(material)()
        return {name: change(run) if name in names else run for name, run in runs.items()}

    return make


def absent(level: float, names: tuple[str, ...] = tuple(FLOWS)) -> Callable[[], Runs]:
    """Return the maker of runs with a constant stress and no fluid."""
    return changed(names, lambda run: nothing(run, level))


def swapped() -> Runs:
    """Return the runs with the stresses of two of them exchanged."""
    runs = recorded(Giesekus(0.3, **SCALE))()
    slow, fast = runs["slow.csv"], runs["fast.csv"]
    runs["slow.csv"] = replace(slow, stress=fast.stress)
    runs["fast.csv"] = replace(fast, stress=slow.stress)
    return runs


def drying() -> Runs:
    """Return runs whose stress grows with the square root of time: a skin of the sample."""
    runs = recorded()()
    return {n: replace(r, stress=r.stress * (1 + 0.1 * np.sqrt(r.time))) for n, r in runs.items()}


def relaxations(*others: str) -> Callable[[], Runs]:
    """Return relaxations after 3 % strain, and some sound runs."""

    def make() -> Runs:
        times = np.geomspace(0.01, 5.0, 100)
        runs = {n: r for n, r in recorded()().items() if n in others}
        both = Modes(UCM, UpperConvectedMaxwell(60.0, 0.1))
        for name, strain in (("step.csv", 0.03), ("step2.csv", 0.06)):
            # its strain is there within the first samples, as an instrument records it
            run = relaxation_as_run(both, strain, 0.02, times)
            ramp = strain * -np.expm1(-times / 0.02)
            rate = strain / 0.02 * np.exp(-times / 0.02)
            runs[name] = replace(run, rate=rate, strain=ramp)
        return runs

    return make


def alternations(material: Material, frequency: float, cycles: float) -> Callable[[], Runs]:
    """Return oscillations in steady alternation."""
    times = np.linspace(0.0, cycles * 2 * np.pi / frequency, 200)
    strains = {"one.csv": 0.5, "two.csv": 1.0, "three.csv": 2.0, "held.csv": 1.5}

    def make() -> Runs:
        return {
            name: alternation_as_from_rest(material, strain * frequency, frequency, times)
            for name, strain in strains.items()
        }

    return make


def of_level(level: float) -> Noise:
    """Return white noise of a size in Pa."""
    return lambda stress, generator: stress + level * generator.standard_normal(len(stress))


def then(first: Noise, second: Noise) -> Noise:
    return lambda stress, generator: second(first(stress, generator), generator)


def thrown(share: float) -> Noise:
    """Return 1 % white noise with outliers of about the rms of the run."""
    return then(white(0.01), lambda s, g: noises.outliers(s, share, 1.0, g))


def quantised(step: float) -> Noise:
    """Return 0.2 % white noise, read by a converter with steps of a share of the largest stress."""

    def read(stress, generator):
        size = step * np.max(np.abs(stress))
        return size * np.round(noises.white(stress, 0.002, generator) / size)

    return read


TWO = ([80.0, 60.0], [1.0, 0.1])
PER_MODE = multimode_giesekus([0.1, 0.7], *TWO)
RP = RoliePoly(1.0, 0.0, **SCALE)
GIESEKUS = Giesekus(0.3, **SCALE)

CONTROLS = {
    "control_ucm": Case("UCM", recorded(), model=KNOWN, compare=KNOWN, library=True),
    "control_ucm_constants_fitted": Case("UCM", recorded(), model=FITTED),
    "control_giesekus": Case(
        "Giesekus", recorded(GIESEKUS), model=known("giesekus", alpha="fit"), compare=KNOWN,
        library=True,
    ),
    "control_johnson_segalman": Case(
        "Johnson–Segalman", recorded(JohnsonSegalman(0.4, **SCALE)),
        model=known("johnson_segalman", xi="fit"), compare=KNOWN, library=True,
    ),
    "control_ptt_exponential": Case(
        "exponential PTT", recorded(PhanThienTanner(0.3, "exponential", **SCALE)),
        model=known("ptt_exponential", epsilon="fit"),
    ),
    "control_fene_p": Case(
        "FENE-P", recorded(FenePeterlin(30.0, **SCALE)), model=known("fene_p", L2="fit")
    ),
    "control_two_modes": Case(
        "two Maxwell modes", recorded(Modes(UCM, UpperConvectedMaxwell(60.0, 0.1))),
        model={"law": "ucm", "modes": "lve"}, modes=([G, 60.0], [1.0, 0.1]),
    ),
    "control_loud": Case("UCM, noise 8 %", recorded(), white(0.08), model=KNOWN, compare=KNOWN,
                         library=True),
    "control_nothing_held_out": Case("UCM", recorded(), model=KNOWN, held_out=()),
    "control_correlated_noise": Case(
        "UCM, AR(1) noise 3 %", recorded(), lambda s, g: noises.correlated(s, 0.03, 0.9, g),
        model=KNOWN, compare=KNOWN, library=True,
    ),
    "control_proportional_noise": Case(
        "UCM, noise 5 % of each value", recorded(), lambda s, g: noises.proportional(s, 0.05, g),
        model=KNOWN,
    ),
    "control_fine_converter": Case("UCM, steps of 0.5 %", recorded(), quantised(0.005),
                                   model=KNOWN),
    "coarse_converter": Case("UCM, steps of 10 %", recorded(), quantised(0.1), model=KNOWN,
                             compare=KNOWN, library=True),
    "outliers_2": Case("UCM, 2 % outliers", recorded(), thrown(0.02), model=KNOWN),
    "outliers_10": Case("UCM, 10 % outliers", recorded(), thrown(0.1), model=KNOWN, compare=KNOWN,
                        library=True),
    "outliers_5_and_mobility": Case(
        "Giesekus, 5 % outliers", recorded(GIESEKUS), thrown(0.05),
        planted={"giesekus_mobility": {"alpha": 0.3}}, model=KNOWN, compare=KNOWN, library=True,
    ),
}  # fmt: skip

PLANTED = {
    "mobility": Case("Giesekus", recorded(GIESEKUS),
                     planted={"giesekus_mobility": {"alpha": 0.3}}, model=KNOWN),
    "ptt": Case("linear PTT", recorded(PhanThienTanner(0.3, "linear", **SCALE)),
                planted={"ptt_linear": {"epsilon": 0.3}}, model=KNOWN),
    "ptt_exponential": Case(
        "exponential PTT", recorded(PhanThienTanner(0.3, "exponential", **SCALE)),
        planted={"ptt_exponential": {"epsilon": 0.3}}, model=KNOWN,
    ),
    "non_affine": Case("Johnson–Segalman", recorded(JohnsonSegalman(0.3, **SCALE)),
                       planted={"non_affine_motion": {"xi": 0.3}}, model=KNOWN),
    "constraint_release": Case(
        "Rolie–Poly without stretch", recorded(RP),
        planted={"convective_constraint_release": {"c": 1 / 3, "beta": 1.0}}, model=KNOWN,
        compare=KNOWN, library=True,
    ),
    "solvent": Case("UCM and a solvent", recorded(Modes(UCM, Newtonian(15.0))),
                    planted={"solvent_viscosity": {}}, model=KNOWN),
    "second_mode": Case("two modes", recorded(Modes(UCM, UpperConvectedMaxwell(60.0, 0.2))),
                        planted={"relaxation_mode": {"G": 60.0, "lambda": 0.2}}, model=KNOWN),
    "moore": Case("UCM, Moore's structure", recorded(Thixotropic(UCM, 0.2, 4.0)),
                  planted={"thixotropy": {"breakdown": 0.2, "build_up_time": 4.0}}, model=KNOWN),
    "slip": Case("wall slip", recorded(slip=0.002), planted={"wall_slip": {"slip": 0.002}},
                 model=KNOWN),
    "compliance": Case("compliance", recorded(compliance=0.002),
                       planted={"tool_compliance": {"compliance": 0.002}}, model=KNOWN),
    "slip_inertia_friction": Case(
        "slip 0.5, with inertia and friction of the tool",
        recorded(slip=0.005, inertia=10.0, friction=12.0),
        planted={"wall_slip": {"slip": 0.005}, "instrument_inertia": {"inertia": 10.0},
                 "bearing_friction": {"friction": 12.0}}, model=KNOWN, loop={"max_effects": 3},
    ),
    "friction": Case("friction", recorded(friction=10.0),
                     planted={"bearing_friction": {"friction": 10.0}}, model=KNOWN),
    "offset": Case("offset", recorded(offset=8.0), planted={"stress_offset": {"offset": 8.0}},
                   model=KNOWN, compare=KNOWN),
    "drift": Case("drift", recorded(drift=2.0), planted={"stress_drift": {"drift": 2.0}},
                  model=KNOWN),
    "lag": Case("lag", recorded(lag=0.15), planted={"transducer_lag": {"tau": 0.15}}, model=KNOWN),
    "rise_time": Case("rise time", recorded(rise_time=0.2),
                      planted={"rate_rise_time": {"tau": 0.2}}, model=KNOWN),
    "gain": Case("gain", recorded(gain=-0.1), planted={"stress_gain": {"gain_error": -0.1}},
                 same_as=("rate_gain",), model=KNOWN),
    "mobility_and_offset": Case(
        "Giesekus, offset", recorded(GIESEKUS, offset=8.0),
        planted={"giesekus_mobility": {"alpha": 0.3}, "stress_offset": {"offset": 8.0}},
        model=KNOWN,
    ),
}  # fmt: skip

EMPTY = {
    "noise_seed_a": Case("noise alone", absent(0.0), of_level(50.0), signal=False, model=KNOWN,
                         compare=KNOWN),
    "noise_seed_b": Case("noise alone", absent(0.0), of_level(80.0), signal=False, model=KNOWN),
    "noise_constants_fitted": Case("noise alone", absent(0.0), of_level(50.0), signal=False,
                                   model=FITTED),
    "noise_giesekus_fitted": Case("noise alone", absent(0.0), of_level(50.0), signal=False,
                                  model=fitted("giesekus", alpha="fit")),
    "dead_sensor": Case("42 Pa and noise", absent(42.0), of_level(2.0), signal=False, model=KNOWN,
                        compare=KNOWN),
    "dead_sensor_constants_fitted": Case("42 Pa and noise", absent(42.0), of_level(2.0),
                                         signal=False, model=FITTED),
    "dead_in_one_run": Case(
        "UCM, one run of 42 Pa", absent(42.0, ("fast.csv",)), outside=True, model=KNOWN
    ),
}  # fmt: skip

MISREAD = {
    "relaxations_as_runs": Case(
        "two modes after a step of strain", relaxations(), outside=True, model=FITTED,
        same_as=("relaxation_mode",), held_out=("step2.csv",),
    ),
    "relaxations_beside_runs": Case(
        "two modes after a step of strain", relaxations("fast.csv", "wave.csv"), outside=True,
        model=KNOWN, held_out=("step2.csv",),
    ),
    "alternation_ucm": Case(
        "UCM in steady alternation", alternations(UCM, 1.0, 2.0), outside=True, model=KNOWN
    ),
    "alternation_ucm_long": Case(
        "UCM in steady alternation", alternations(UCM, 1.0, 8.0), outside=True, model=KNOWN
    ),
    "alternation_giesekus": Case(
        "Giesekus in steady alternation", alternations(GIESEKUS, 1.0, 3.0), outside=True,
        model=KNOWN, same_as=("giesekus_mobility",), compare=KNOWN,
    ),
    "units_of_one_run": Case(
        "one stress tenfold", changed(("fast.csv",), lambda r: scaled(r, 10.0)), outside=True,
        model=KNOWN, compare=KNOWN,
    ),
    "clock_of_one_run": Case(
        "one time a hundredfold", changed(("slow.csv",), lambda r: scaled(r, 1.0, 100.0)),
        outside=True, model=KNOWN,
    ),
    "wrong_sign_of_one_run": Case(
        "one stress negative", changed(("wave.csv",), lambda r: scaled(r, -1.0)), outside=True,
        model=KNOWN,
    ),
    "runs_exchanged": Case("stresses of two runs exchanged", swapped, outside=True,
                           model=known("giesekus", alpha="fit"), compare=KNOWN),
    # of Giesekus: with UCM a slow clock is in σ12 exactly a compliance, (1 + GC) σ' = Gγ̇ − σ/λ
    "clock_slip": Case("clock 12 % slow, Giesekus", recorded(GIESEKUS, clock_slip=0.12),
                       outside=True, model=known("giesekus", alpha=0.3)),
    "clipped_motor": Case("rates over 1.6 1/s not reached", recorded(fastest=1.6), outside=True,
                          model=KNOWN),
    "saturated": Case("stresses over 150 Pa cut", recorded(limit=150.0), outside=True, model=KNOWN,
                      compare=KNOWN),
}  # fmt: skip

OUTSIDE = {
    "two_mode_giesekus": Case(
        "α 0.1 and 0.7", recorded(PER_MODE), outside=True, model=fitted("giesekus", alpha="fit"),
        same_as=("relaxation_mode",), compare=fitted("ucm"),
    ),
    "two_mode_giesekus_known_modes": Case(
        "α 0.1 and 0.7", recorded(PER_MODE), outside=True, modes=TWO,
        model={"law": "giesekus", "modes": "lve", "parameters": {"alpha": "fit"}},
        compare={"law": "ucm", "modes": "lve"},
    ),
    "pom_pom": Case("pom-pom", recorded(PomPom(5.0, 0.4, **SCALE)), outside=True, model=KNOWN,
                    compare=KNOWN),
    "extended_pom_pom": Case(
        "extended pom-pom", recorded(ExtendedPomPom(5.0, 0.1, 0.4, **SCALE)), outside=True,
        model=KNOWN, compare=KNOWN,
    ),
    "rolie_poly": Case(
        "Rolie–Poly with stretch", recorded(RoliePoly(1.0, 0.1, **SCALE)), outside=True,
        same_as=("convective_constraint_release",), model=KNOWN, compare=KNOWN,
    ),
    "k_bkz": Case("K-BKZ", recorded(KBKZ(0.2, **SCALE)), outside=True, model=KNOWN, compare=KNOWN),
    "white_metzner": Case("White–Metzner", recorded(WhiteMetzner(0.5, **SCALE)), outside=True,
                          model=KNOWN, compare=KNOWN),
    "square_kinetics": Case(
        "structure broken by γ̇²", recorded(Thixotropic(UCM, 0.15, 4.0, 2.0)), outside=True,
        same_as=("thixotropy",), model=KNOWN, compare=KNOWN,
    ),
    "drying": Case("stress grows as the root of time", drying, outside=True, model=KNOWN,
                   compare=KNOWN),
}  # fmt: skip

CASES: dict[str, Case] = {**EMPTY, **OUTSIDE, **MISREAD, **CONTROLS, **PLANTED}
