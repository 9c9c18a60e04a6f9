"""What an evaluator might hand over, and what is true of it. Rules are in `hostile_fluids.py`."""

import numpy as np
from hostile_fluids_laboratory import (
    Ageing,
    CriticalSlip,
    Networked,
    PlatePlate,
    averaged,
    each,
    growths,
    mislabelled,
    sweep_of,
    times_stress,
    to_strain,
    warmed,
    with_n1,
)
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
    with_strays,
)
from hostile_fluids_records import (
    ALL,
    DAMPED,
    FEW,
    FITTED,
    GIESEKUS,
    KNOWN,
    MOBILITY,
    ONE,
    ONE_HELD,
    POM_POM,
    SARAMITO,
    SCALE,
    SLOW,
    SLOW_ALONE,
    SQUARE,
    TWO,
    UCM,
    UNEQUAL,
    UNEVEN,
    Case,
    _Strange,
    alternating,
    changed,
    creeping,
    curve,
    fractured,
    late,
    later_zero,
    only,
    recorded,
    stress_of,
    swept,
    wrong,
)
from independent import (
    KBKZ,
    Giesekus,
    JohnsonSegalman,
    Modes,
    Newtonian,
    PhanThienTanner,
    RoliePoly,
    UpperConvectedMaxwell,
    WhiteMetzner,
    start_up,
)

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
    "proportional_ucm": Case("Maxwell, 5 % of each value", recorded(),
                              proportional(0.05), terms={}),
    "quantised_ucm": Case("Maxwell, steps of 4 %", recorded(), steps_of(0.04), terms={}),
    "quantised_weak": Case("Giesekus, 0.005, steps of 4 %", recorded(Giesekus(0.005, **SCALE)),
                           steps_of(0.04), planted={"giesekus_mobility": {"alpha": 0.005}},
                           terms={"sigma.sigma": 0.005}),
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
    "k_bkz": Case("K-BKZ", recorded(KBKZ(0.25, **SCALE)), planted=DAMPED, outside=True),
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
    "rubber": Case("no fluid: a rubber with a dashpot", recorded(Rubber()), outside=True,
                   model=FITTED, same_as=("solvent_viscosity",)),
    # a Maxwell fluid that does not relax, and a solvent, are one
    "rubber_told": Case("no fluid: a rubber", recorded(Rubber()), outside=True,
                        same_as=("solvent_viscosity", "sigma")),
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
    "begins_late": Case("Giesekus, recorded from 0.8 s on",
                        recorded(GIESEKUS, late(0.8)), **_SHEAR),
    "clock_late": Case("Giesekus, clock 0.4 s late", changed(later_zero(0.4), GIESEKUS),
                       outside=True, same_as=("giesekus_mobility",)),
    "clock_late_ucm": Case("Maxwell, clock 0.4 s late", changed(later_zero(0.4)), outside=True),
    # nothing but the declared law is to be seen in slow runs, and to say so is right
    "slow_alone": Case("Giesekus, all runs slow, none held out", recorded(GIESEKUS, SLOW_ALONE),
                       held_out=(), planted=MOBILITY),
    "slow_then_fast": Case("Giesekus, fitted runs slow", recorded(GIESEKUS, SLOW),
                           planted=MOBILITY),
    "slow_pom_pom": Case("pom-pom, fitted runs slow", recorded(POM_POM, SLOW), outside=True),
    "one_run": Case("Giesekus, one start-up", recorded(GIESEKUS, ONE), held_out=(), **_SHEAR),
    "one_run_pom_pom": Case("pom-pom, one start-up", recorded(POM_POM, ONE), held_out=(),
                            outside=True),
    "one_run_pom_pom_held": Case("pom-pom, one start-up fitted", recorded(POM_POM, ONE_HELD),
                                 outside=True),
    "one_run_k_bkz": Case("K-BKZ, one start-up", recorded(KBKZ(0.25, **SCALE), ONE), held_out=(),
                          planted=DAMPED),
    "one_run_fractional": Case("fractional Maxwell, one start-up, constants fitted",
                               recorded(fractional(), ONE), held_out=(), outside=True,
                               model=FITTED, same_as=("relaxation_mode",)),
    "one_run_ucm_fitted": Case("Maxwell, one start-up, constants fitted", recorded(UCM, ONE),
                               held_out=(), model=FITTED, terms={}),
}  # fmt: skip
NONE_HELD = {
    f"{which}_{name}": Case(
        f"{material.truth}, {which} runs, none held out", recorded(material.fluid, flows),
        outside=True, same_as=material.same_as, planted=material.planted, held_out=(),
    )
    for which, flows in (("three", ALL), ("two", TWO))
    for name, material in {
        "pom_pom": _Strange("pom-pom", POM_POM),
        "k_bkz": _Strange("K-BKZ", KBKZ(0.25, **SCALE), planted=DAMPED),
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
                              planted=DAMPED, outside=True),
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
    "curve_k_bkz": Case("K-BKZ, a flow curve", only("held.csv", KBKZ(0.25, **SCALE)),
                        tables=curve(KBKZ(0.25, **SCALE)), planted=DAMPED),
}  # fmt: skip

_RATES = {"a.csv": 0.5, "b.csv": 1.0, "c.csv": 2.0, "d.csv": 4.0, "held.csv": 3.0}
_FEW_LOG = growths(np.geomspace(0.05, 8.0, 15), _RATES)
_FIVE = growths(np.linspace(0.1, 8.0, 80), _RATES)
_LOW = growths(np.geomspace(0.1, 20.0, 80), {"a.csv": 0.05, "b.csv": 0.1, "c.csv": 0.2})
THREE_TIMES, THREE_MODULI = (10.0, 1.0, 0.1), (20.0, 60.0, 120.0)
OF_THREE_MODES = {
    "a.csv": (start_up(0.1), np.geomspace(0.1, 40.0, 80)),
    "b.csv": (start_up(1.0), np.geomspace(0.05, 20.0, 80)),
    "c.csv": (start_up(5.0), np.geomspace(0.02, 6.0, 80)),
    "held.csv": (start_up(2.0), np.geomspace(0.03, 10.0, 80)),
}
TOLD_BY_SWEEP = {"law": "ucm", "modes": "lve"}
_WRONG_SWEEP = {
    "tables": sweep_of((23.0, 52.2, 134.4), THREE_TIMES), "model": TOLD_BY_SWEEP, "outside": True,
    "same_as": (*_GAINS, "relaxation_mode"),
}  # fmt: skip
_BOTH = Modes(
    Giesekus(0.3, 60.0, 1.0),
    PhanThienTanner(0.3, "linear", modulus=60.0, relaxation_time=0.2),
)
_WITH_N1 = {"told": {"observe": ["sigma12", "N1"]}, "outside": True,
            "same_as": ("giesekus_mobility",)}  # fmt: skip
_ALSO_GIESEKUS = {"outside": True, "same_as": ("giesekus_mobility",)}
LABORATORY = {
    "plates_giesekus": Case("Giesekus between plates, torque not corrected",
                            recorded(PlatePlate(GIESEKUS)), **_ALSO_GIESEKUS),
    "plates_strong": Case("Giesekus of 0.6 between plates, torque not corrected",
                          recorded(PlatePlate(Giesekus(0.6, **SCALE))), **_ALSO_GIESEKUS),
    "plates_js": Case("Johnson–Segalman between plates, torque not corrected",
                      recorded(PlatePlate(JohnsonSegalman(0.3, **SCALE))), outside=True,
                      same_as=("non_affine_motion",)),
    "plates_ptt": Case("linear PTT between plates, torque not corrected",
                       recorded(PlatePlate(PhanThienTanner(0.3, "linear", **SCALE))),
                       outside=True, same_as=("ptt_linear",)),
    "wrong_sweep": Case("three Maxwell modes, moduli told 15, −13 and 12 % off",
                        recorded(Modes(*map(UpperConvectedMaxwell, THREE_MODULI, THREE_TIMES)),
                                 OF_THREE_MODES),
                        **_WRONG_SWEEP),
    "mixed_laws": Case("Giesekus in one mode, linear PTT in the other", recorded(_BOTH),
                       tables=sweep_of((60.0, 60.0), (1.0, 0.2)), model=TOLD_BY_SWEEP, outside=True,
                       same_as=("giesekus_mobility", "ptt_linear")),
    "few_log_k_bkz": Case("K-BKZ, 15 samples a run, evenly in log t",
                          recorded(KBKZ(0.25, **SCALE), _FEW_LOG), planted=DAMPED),
    "short_k_bkz": Case("K-BKZ, start-ups that end at a strain of 1.2",
                        recorded(KBKZ(0.25, **SCALE), to_strain(1.2, _RATES)), planted=DAMPED),
    "low_ptt": Case("linear PTT, Wi up to 0.2, none held out",
                    recorded(PhanThienTanner(0.3, "linear", **SCALE), _LOW), held_out=(),
                    planted={"ptt_linear": {"epsilon": 0.3}}),
    "mislabelled": Case("Giesekus, one rate told 20 % high",
                        each(mislabelled("b.csv", 1.2), flows=_FIVE), **_ALSO_GIESEKUS),
    "fillings": Case("Giesekus, gaps filled by 1, 1.05, 0.95, held 1.03",
                     each(times_stress({"fast.csv": 1.05, "wave.csv": 0.95, "held.csv": 1.03})),
                     **_ALSO_GIESEKUS),
    "warmed": Case("Giesekus, relaxation times 1, 0.95, 0.9, held 0.85 s",
                   warmed({"slow.csv": 1.0, "fast.csv": 0.95, "wave.csv": 0.9, "held.csv": 0.85}),
                   **_ALSO_GIESEKUS),
    "averaged": Case("Giesekus, means over 0.5 s told", averaged(0.5), **_ALSO_GIESEKUS),
    "n1_offset": Case("Giesekus, N1 fitted too, 20 Pa on it", each(with_n1(20.0)), **_WITH_N1),
    "n1_gain": Case("Giesekus, N1 fitted too, read 15 % high", each(with_n1(gain=1.15)),
                    **_WITH_N1),
    "networked": Case("Giesekus in a permanent network of 15 Pa", recorded(Networked(GIESEKUS)),
                      outside=True, same_as=("giesekus_mobility", "relaxation_mode")),
    "ageing": Case("Giesekus, its time grows by 3 % a second", recorded(Ageing(GIESEKUS)),
                   **_ALSO_GIESEKUS),
    "critical_slip": Case("Giesekus, slip beyond 60 Pa, with a memory",
                          recorded(CriticalSlip(GIESEKUS)), outside=True,
                          same_as=("giesekus_mobility", "wall_slip")),
}  # fmt: skip

LABORATORY_AND_BEFORE: dict[str, Case] = {
    **EMPTY, **FLUIDS, **FAULTS, **SAMPLING, **NONE_HELD, **TESTS, **DECLARED, **NOISY,
    **LABORATORY,
}  # fmt: skip
