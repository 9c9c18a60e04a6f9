"""What a folder holds that has no start-up in shear, or tells of it wrongly, and what is true.

Fluids that no library holds in one test alone, normal stresses beside the shear stress, two
geometries and temperatures, and constants that are declared as known and are not.
"""

from collections.abc import Callable, Mapping

import numpy as np
from hostile_fluids_evaluators import late_axially, pulled, sweep_of_modes, with_first_difference
from hostile_fluids_evaluators_cases import CASES as EVALUATORS_AND_BEFORE
from hostile_fluids_laboratory import PlatePlate, each, warmed
from hostile_fluids_materials import white
from hostile_fluids_records import (
    DAMPED,
    FITTED,
    FLOWS,
    GIESEKUS,
    KNOWN,
    MOBILITY,
    POM_POM,
    SCALE,
    SQUARE,
    UCM,
    Case,
    Record,
    Sampled,
    _record,
    alternating,
    creeping,
    curve,
    only,
    recorded,
    swept,
    wrong,
)
from independent import (
    KBKZ,
    Giesekus,
    Modes,
    PhanThienTanner,
    RoliePoly,
    SoftGlass,
    WhiteMetzner,
    oscillation,
    start_up,
    step_strain,
    steps,
)
from independent.flow import Flow
from independent.instruments import Instrument
from independent.material import Material, RateLaw

Maker = Callable[[], dict[str, Record]]
_GROWTH = np.linspace(0.1, 8.0, 80)
_WEAK: Sampled = {
    "slow.csv": (start_up(0.1), _GROWTH),
    "fast.csv": (start_up(0.2), _GROWTH),
    "wave.csv": (oscillation(0.2, 1.0), np.linspace(0.1, 12.0, 120)),
    "held.csv": (start_up(0.3), _GROWTH),
}
_PAUSED_AT = np.union1d(np.linspace(0.05, 12.0, 140), [3.995, 4.0, 6.995, 7.0])
PAUSED: Sampled = {
    name: (steps([0.0, 4.0, 7.0], [rate, 0.0, rate]), _PAUSED_AT)
    for name, rate in {"a.csv": 0.3, "b.csv": 1.0, "c.csv": 3.0, "held.csv": 2.0}.items()
}


def _after(material: Material, flow: Flow, begin: float, after: np.ndarray, **cells) -> Record:
    """Return the record of a flow from a time on, which is its zero."""
    run = _record(Instrument().record(material, flow, begin + after), **cells)
    run.columns["time_s"] = after
    return run


def relaxing(material: Material, takes: float = 0.02) -> Maker:
    """Return the maker of relaxations after steps of strain, each put on in a declared time."""
    strains = {"a.csv": 0.5, "b.csv": 1.5, "c.csv": 3.0, "held.csv": 2.0}
    after = np.geomspace(0.02, 6.0, 60)

    def make() -> dict[str, Record]:
        return {
            name: _after(
                material, step_strain(strain, takes), takes, after,
                step_strain=strain, step_time_s=takes,
            )
            for name, strain in strains.items()
        }  # fmt: skip

    return make


def stopped(material: Material, then: Mapping[str, float] | None = None) -> Maker:
    """Return the maker of stresses after a steady flow has stopped; `then` are start-ups beside.

    Where there are start-ups, the cessation that would be held out is fitted.
    """
    rates = {"a.csv": 0.5, "b.csv": 1.0, "c.csv": 3.0, "d.csv" if then else "held.csv": 2.0}
    after, lasted = np.linspace(0.0, 5.0, 80), 25.0

    def make() -> dict[str, Record]:
        made = {
            name: _after(
                material, steps([0.0, lasted], [rate, 0.0]), lasted, after,
                start="steady", rate_before_1_s=rate,
            )
            for name, rate in rates.items()
        }  # fmt: skip
        starts: Sampled = {name: (start_up(rate), _GROWTH) for name, rate in (then or {}).items()}
        return made | recorded(material, starts)()

    return make


def then_sheared(law: RateLaw, rate: float = 1.0) -> Maker:
    """Return the maker of uniaxial extensions, with a start-up in shear held out."""

    def make() -> dict[str, Record]:
        made = pulled(law, lambda stress, times, hencky: stress)()
        made["d.csv"] = made.pop("held.csv")
        (sheared,) = recorded(law, {"held.csv": (start_up(rate), _GROWTH)})().values()
        sheared.cells["flow"] = "shear"
        return {**made, "held.csv": sheared}

    return make


def expanding(size: float, time: float):
    """Return N1 of a tool that warms, and grows."""
    return lambda times, run: run.N1 + size * -np.expm1(-times / time)


def of_two_geometries(law: RateLaw, plates: tuple[str, ...]) -> Maker:
    """Return the maker of runs of which some come from plates, torque not corrected."""

    def make() -> dict[str, Record]:
        runs = recorded(law)()
        rim = recorded(PlatePlate(law), {name: FLOWS[name] for name in plates})()
        return {**runs, **rim}

    return make


def shifted(factors: Mapping[str, tuple[float, float]]) -> Maker:
    """Return the maker of runs at several temperatures, shifted to one by factors that are off.

    Parameters
    ----------
    factors
        Of the time, by run: the one that is declared, and the one that is true.
    """

    def make() -> dict[str, Record]:
        runs = warmed({name: true / told for name, (told, true) in factors.items()})()
        for name, run in runs.items():
            run.cells["a_T"] = factors[name][0]
        return runs

    return make


def growing(share: float, at: float):
    """Return noise whose share of a stress grows with its square, and is `share` at a stress."""

    def put(stress, lot):
        return stress * (1 + share * (stress / at) ** 2 * lot.standard_normal(len(stress)))

    return put


_KBKZ, _ROLIE = KBKZ(0.25, **SCALE), RoliePoly(1.0, 0.1, **SCALE)
_WHITE, _GLASS = WhiteMetzner(0.5, **SCALE), SoftGlass(0.2, 0.2, **SCALE)
_PTT = PhanThienTanner(0.3, "linear", **SCALE)
_TWO = (60.0, 80.0), (3.0, 0.4)
_RELEASE = {"outside": True, "same_as": ("convective_constraint_release",)}
_CREEP = {"model": wrong(solvent_viscosity_Pa_s=5.0)}
_OBSERVED = {"told": {"observe": ["sigma12", "N1"]}, "outside": True}
_LATE = ("transducer_lag", "time_delay", "rate_rise_time")

FOLDERS = {
    "relaxation_k_bkz": Case("K-BKZ, relaxation after steps of strain alone", relaxing(_KBKZ),
                             planted=DAMPED),
    "relaxation_rolie_poly": Case("stretching Rolie–Poly, relaxation after steps of strain alone",
                                  relaxing(_ROLIE), **_RELEASE),
    "relaxation_pom_pom": Case("pom-pom, relaxation alone, modulus and time fitted",
                               relaxing(POM_POM), model=FITTED, outside=True),
    "creep_white_metzner": Case("White–Metzner, creep and recovery alone", creeping(_WHITE),
                                outside=True, **_CREEP),
    "creep_soft_glass": Case("a soft glass, creep and recovery alone", creeping(_GLASS),
                             outside=True, **_CREEP),
    "creep_giesekus": Case("Giesekus, creep and recovery alone", creeping(GIESEKUS),
                           planted=MOBILITY, terms=SQUARE, **_CREEP),
    "extension_pom_pom": Case("pom-pom, extension alone, shear held out", then_sheared(POM_POM),
                              outside=True),
    "extension_non_affine": Case(
        "linear PTT with slip of the network, extension alone, shear held out",
        then_sheared(PhanThienTanner(0.2, "linear", 0.2, **SCALE)),
        planted={"ptt_linear": {"epsilon": 0.2}, "non_affine_motion": {"xi": 0.2}},
    ),
    "curve_rolie_poly": Case("stretching Rolie–Poly, a flow curve, a start-up held out",
                             only("held.csv", _ROLIE), tables=curve(_ROLIE), **_RELEASE),
    "curve_two_mobilities": Case(
        "Giesekus of 0.1 and 0.5 in two modes, one fitted, a flow curve, a start-up held out",
        only("held.csv", Modes(*map(Giesekus, (0.1, 0.5), *_TWO))),
        tables=curve(Modes(*map(Giesekus, (0.1, 0.5), *_TWO))), model=FITTED, outside=True,
        same_as=("giesekus_mobility", "relaxation_mode"),
    ),
    "sweep_rolie_poly": Case("stretching Rolie–Poly, an amplitude sweep, a start-up held out",
                             only("held.csv", _ROLIE), tables=swept(_ROLIE), **_RELEASE),
    "stopped_k_bkz": Case("K-BKZ, cessation alone", stopped(_KBKZ), planted=DAMPED),
    "stopped_pom_pom": Case("pom-pom, cessation, a start-up held out",
                            stopped(POM_POM, {"held.csv": 1.5}), outside=True),
    "paused_soft_glass": Case("a soft glass, sheared, at rest for 3 s, sheared again",
                              recorded(_GLASS, PAUSED), outside=True),
    "alternation_white_metzner": Case("White–Metzner in steady alternation", alternating(_WHITE),
                                      outside=True),
    "n1_expansion_ucm": Case("Maxwell, N1 fitted too, a tool that grows by 4 Pa over 3 s",
                             each(with_first_difference(expanding(4.0, 3.0)), UCM), terms={},
                             **_OBSERVED),
    "n1_late_ptt": Case("linear PTT, N1 fitted too, 0.05 s behind a soft axis",
                        each(with_first_difference(late_axially(0.05)), _PTT),
                        terms={"tr(sigma)*sigma": 0.3}, same_as=("ptt_linear", *_LATE),
                        **_OBSERVED),
    "wrong_shift": Case("Giesekus at two temperatures, shifted by 0.52 for 0.5",
                        shifted({"slow.csv": (1.0, 1.0), "fast.csv": (0.52, 0.5),
                                 "wave.csv": (1.0, 1.0), "held.csv": (0.52, 0.5)}),
                        planted=MOBILITY, terms=SQUARE, outside=True,
                        told={"clock_factor": "a_T"}),
    "wave_of_plates": Case("Giesekus, the wave between plates, torque not corrected, cone else",
                           of_two_geometries(GIESEKUS, ("wave.csv",)), planted=MOBILITY,
                           terms=SQUARE, outside=True),
    "weak_rolie_poly": Case("stretching Rolie–Poly, λγ̇ up to 0.2, held out 0.3, 0.5 % noise",
                            recorded(_ROLIE, _WEAK), white(0.005), **_RELEASE),
    "quiet_rise": Case("Giesekus, 0.1 % noise, a motor that takes 0.02 s",
                       recorded(GIESEKUS, rise_time=0.02), white(0.001),
                       planted={**MOBILITY, "rate_rise_time": {"tau": 0.02}}, terms=SQUARE,
                       same_as=_LATE),
    "louder_k_bkz": Case("K-BKZ, noise that grows with the stress, 3 % at 60 Pa", recorded(_KBKZ),
                         growing(0.03, 60.0), planted=DAMPED, outside=True),
    "known_offset": Case("Giesekus, an offset of 5 Pa declared as known that is not there",
                         recorded(GIESEKUS), planted=MOBILITY, terms=SQUARE, outside=True,
                         model={**KNOWN, "effects": {"stress_offset": {"offset": 5.0}}}),
    "by_mode_ptt": Case("linear PTT in two modes, declared as Giesekus with mobilities by mode",
                        recorded(Modes(*(PhanThienTanner(0.3, "linear", 0.0, g, t)
                                         for g, t in zip(*_TWO, strict=True)))),
                        tables=sweep_of_modes(*map(np.array, _TWO)), outside=True,
                        same_as=("ptt_linear", "tr(sigma)*sigma"),
                        model={"law": "giesekus", "parameters": {"alpha": "fit"},
                               "by_mode": ["alpha"], "modes": "lve"}),
}  # fmt: skip

CASES: dict[str, Case] = {**EVALUATORS_AND_BEFORE, **FOLDERS}
