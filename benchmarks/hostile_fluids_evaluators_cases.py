"""What evaluators find in drawers, and what is true of it."""

import numpy as np
from hostile_fluids_benches_cases import CASES as BENCHES_AND_BEFORE
from hostile_fluids_cases import OF_THREE_MODES, TOLD_BY_SWEEP
from hostile_fluids_evaluators import (
    LOGARITHMIC,
    SLOW_START,
    TWO_RATES,
    apparent,
    broad,
    by_cox_and_merz,
    digitised,
    distorted,
    humming,
    in_haste,
    late_axially,
    necked,
    of_plates,
    over_first_area,
    planar_told_uniaxial,
    pulled,
    read_by_hand,
    rested,
    ringing_creep,
    settling,
    soft_steps,
    spliced,
    sticking,
    sweep_at,
    sweep_of_modes,
    thrown_out,
    with_first_difference,
)
from hostile_fluids_exports import of_stress, on_instruments
from hostile_fluids_laboratory import each
from hostile_fluids_mixtures_cases import batches
from hostile_fluids_records import (
    DAMPED,
    FITTED,
    GIESEKUS,
    KNOWN,
    MOBILITY,
    SARAMITO,
    SCALE,
    SQUARE,
    Case,
    recorded,
)
from independent import KBKZ, Giesekus, Modes, PhanThienTanner, PomPom

_RIGHT = {"planted": MOBILITY, "terms": SQUARE}
_FLAWED = {**_RIGHT, "outside": True}
_WITH_N1 = {**_FLAWED, "told": {"observe": ["sigma12", "N1"]}}
_PTT = PhanThienTanner(0.3, "linear", **SCALE)
_MODULI, _TIMES = broad()
_THREE = (20.0, 60.0, 120.0), (10.0, 1.0, 0.1)


def _fluid(mobilities) -> Modes:
    return Modes(*(Giesekus(float(a), float(g), float(t))
                   for a, g, t in zip(mobilities, _MODULI, _TIMES, strict=True)))  # fmt: skip


_BROAD = {"tables": sweep_of_modes(_MODULI, _TIMES), "model": TOLD_BY_SWEEP}
_OF_THREE = Modes(*(Giesekus(0.3, g, t) for g, t in zip(*_THREE, strict=True)))
_BRANCHED = Modes(*(PomPom(q, 0.4 * t, g, t)
                    for q, g, t in zip((6.0, 4.0, 2.0), *_THREE, strict=True)))  # fmt: skip

EVALUATORS = {
    "digitised": Case("Giesekus, read from a plot by hand: 22 points, 1 % in time, 2 % in stress",
                      digitised(GIESEKUS), read_by_hand(0.02), **_FLAWED),
    "digitised_k_bkz": Case("K-BKZ, read from a plot by hand",
                            recorded(KBKZ(0.25, **SCALE), LOGARITHMIC), read_by_hand(0.02),
                            planted=DAMPED, outside=True),
    "slip_of_one": Case("Giesekus, the fast run slips, 1.5e-3 1/(Pa s)",
                        on_instruments({"fast.csv": {"slip": 1.5e-3}}), **_FLAWED),
    "first_area": Case("linear PTT in extension, force over the first area",
                       pulled(_PTT, over_first_area), model=FITTED, outside=True),
    "necks": Case("linear PTT in extension, a neck from a strain of 1.5 on", necked(_PTT),
                  planted={"ptt_linear": {"epsilon": 0.3}}, outside=True),
    "planar": Case("linear PTT in planar extension, told as uniaxial",
                   planar_told_uniaxial(_PTT), model=FITTED,
                   planted={"ptt_linear": {"epsilon": 0.3}}, outside=True),
    "creep_rings": Case("Giesekus in creep, a tool of 0.5 Pa s²", ringing_creep(GIESEKUS, 0.5),
                        planted={**MOBILITY, "inertia": {}},
                        same_as=("instrument_inertia", "solvent_viscosity"), outside=True),
    "n1_late": Case("Giesekus, N1 fitted too, behind a soft axis of 0.25 s",
                    each(with_first_difference(late_axially(0.25))), **_WITH_N1),
    "n1_thrown": Case("Giesekus, N1 fitted too, inertia takes 3 Pa at 1 1/s",
                      each(with_first_difference(thrown_out(3.0))), **_WITH_N1),
    "n1_of_plates": Case("Giesekus, N1 fitted too, which is N1 − N2",
                         each(with_first_difference(of_plates)), **_WITH_N1),
    "two_fluids": Case("two runs of Giesekus, two of linear PTT, of one modulus and time",
                       batches({"fast.csv": _PTT, "wave.csv": _PTT}), outside=True,
                       same_as=("giesekus_mobility", "ptt_linear")),
    "settles": Case("Giesekus in a suspension that settles: 8 Pa s, 25 s", each(settling()),
                    same_as=("solvent_viscosity",), **_FLAWED),
    "soft_steps": Case("Giesekus, steps of the rate, a motor that takes 0.06 s",
                       soft_steps(0.06), planted={**MOBILITY, "rate_rise_time": {"tau": 0.06}},
                       terms=SQUARE, outside=True),
    "saramito_two": Case("Saramito, two rates above the yield stress",
                         recorded(SARAMITO, TWO_RATES), planted={"yield_stress": {}},
                         outside=True),
    "saramito_fitted": Case("Saramito, two rates above the yield stress, modulus and time fitted",
                            recorded(SARAMITO, TWO_RATES), model=FITTED,
                            planted={"yield_stress": {}}, outside=True),
    "spliced": Case("Giesekus, 2 % more until 1 s, another card",
                    each(of_stress(spliced(1.0, 0.02))), **_FLAWED),
    "hums": Case("Giesekus, a hum of 1.5 Pa and 0.7 Hz", each(of_stress(humming(1.5, 0.7))),
                 **_FLAWED),
    "sticks": Case("Giesekus, the fast run sticks and slips", each(of_stress(sticking)),
                   **_FLAWED),
    "rested": Case("Giesekus, a structure not back from the run before, by 10, 5, 15 and 10 %",
                   each(of_stress(rested({"slow.csv": 0.1, "fast.csv": 0.05, "wave.csv": 0.15,
                                          "held.csv": 0.1}))), **_FLAWED),
    "distorted": Case("Giesekus, a wave with a third harmonic of 5 % that is not told",
                      distorted(0.1), **_FLAWED),
    "sweep_not_small": Case("Giesekus in three modes, a sweep at a strain of 1",
                            recorded(_OF_THREE, OF_THREE_MODES), tables=sweep_at(_OF_THREE, 1.0),
                            model=TOLD_BY_SWEEP, **_FLAWED),
    "in_haste": Case("Giesekus, a flow curve swept upwards, a second a point, beside runs",
                     recorded(GIESEKUS), tables=in_haste(GIESEKUS), **_FLAWED),
    "apparent": Case("Giesekus, a flow curve of a capillary at apparent rates, beside runs",
                     recorded(GIESEKUS), tables=apparent(GIESEKUS), **_FLAWED),
    "cox_merz": Case("Giesekus, a slow start-up, and a flow curve made by Cox and Merz's rule",
                     recorded(GIESEKUS, SLOW_START), tables=by_cox_and_merz(100.0, 1.0),
                     outside=True, same_as=("giesekus_mobility",)),
    "broad": Case("Giesekus of 0.3 in ten modes, told by a sweep",
                  recorded(_fluid(np.full(10, 0.3)), OF_THREE_MODES), **_RIGHT, **_BROAD),
    "broad_rising": Case("Giesekus in ten modes, 0.1 in the fastest to 0.5 in the slowest",
                         recorded(_fluid(np.linspace(0.5, 0.1, 10)), OF_THREE_MODES),
                         same_as=("giesekus_mobility",), outside=True, **_BROAD),
    "branched": Case("pom-pom in three modes of 6, 4 and 2 arms, told by a sweep",
                     recorded(_BRANCHED, OF_THREE_MODES), outside=True,
                     tables=sweep_of_modes(np.array(_THREE[0]), np.array(_THREE[1])),
                     model=TOLD_BY_SWEEP),
    "two_alike_in_extension": Case("linear PTT in extension, rightly told",
                                   pulled(_PTT, lambda stress, times, rate: stress),
                                   planted={"ptt_linear": {"epsilon": 0.3}}, model=KNOWN,
                                   terms={"tr(sigma)*sigma": 0.3}),
}  # fmt: skip

CASES: dict[str, Case] = {**BENCHES_AND_BEFORE, **EVALUATORS}
