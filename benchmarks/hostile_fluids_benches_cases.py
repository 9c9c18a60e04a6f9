"""Benches that were left as they were, and what is true of them."""

from hostile_fluids_benches import (
    SLOW_THEN_FASTER,
    Couette,
    Evaporating,
    Micelles,
    Repeated,
    Settling,
    cut_cycles,
    loaded,
    median_of,
    noisy_rates,
    ramped,
    saturating,
    stamped,
    strains,
    sweep_between,
    triggered,
    without_rest,
)
from hostile_fluids_cases import OF_THREE_MODES, THREE_MODULI, THREE_TIMES, TOLD_BY_SWEEP
from hostile_fluids_exports import of_stress
from hostile_fluids_laboratory import each
from hostile_fluids_mixtures_cases import CASES as MIXTURES_AND_BEFORE
from hostile_fluids_mixtures_cases import batches
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
    Case,
    recorded,
)
from independent import KBKZ, FenePeterlin, Giesekus, Modes, PhanThienTanner, RoliePoly

_RIGHT = {"planted": MOBILITY, "terms": SQUARE}
_FLAWED = {**_RIGHT, "outside": True}
_GAINS = ("stress_gain", "rate_gain", "modulus_Pa", "relaxation_time_factor")
_BENCH = "small_bench_faults"
_LATE = ("time_delay", "rate_rise_time")  # a step that takes its time is one that comes late
_LINEAR = ("relaxation_mode", "solvent_viscosity")
_THREE = Modes(*(Giesekus(0.3, g, t) for g, t in zip(THREE_MODULI, THREE_TIMES, strict=True)))
_THREE_PTT = Modes(*(PhanThienTanner(0.3, "exponential", modulus=g, relaxation_time=t)
                     for g, t in zip(THREE_MODULI, THREE_TIMES, strict=True)))  # fmt: skip
_CHAINS = Modes(RoliePoly(1.0, 0.1, modulus=40.0, relaxation_time=3.0),
                RoliePoly(1.0, 0.05, modulus=60.0, relaxation_time=1.0),
                RoliePoly(1.0, 0.02, modulus=50.0, relaxation_time=0.3))  # fmt: skip
_EPSILON = {"planted": {"ptt_exponential": {"epsilon": 0.3}}, "same_as": _LINEAR, "outside": True}


def _told(low: float, high: float):
    return {"tables": sweep_between(low, high, THREE_MODULI, THREE_TIMES), "model": TOLD_BY_SWEEP}


BENCHES = {
    "couette": Case("Giesekus between cylinders of the standard, told as of a Newtonian fluid",
                    recorded(Couette(GIESEKUS)), **_FLAWED),
    "gap": Case("Giesekus, all rates 3 % higher than told", recorded(GIESEKUS, rate_gain=0.03),
                planted={**MOBILITY, "rate_gain": {"gain_error": 0.03}}, terms=SQUARE,
                same_as=(*_GAINS, "gammadot", _BENCH), outside=True),
    "clock": Case("Giesekus, a clock that is 2 % fast", recorded(GIESEKUS, clock_slip=0.02),
                  same_as=("relaxation_time_factor", "relaxation_time_s", "sigma", _BENCH),
                  **_FLAWED),
    "noisy_rates": Case("Giesekus, rates as measured, with 3 % noise", noisy_rates(0.03),
                        **_FLAWED),
    "short_rests": Case("Giesekus, rests of 3 s between the runs", without_rest(3.0), **_FLAWED),
    "triggers": Case("Giesekus, clocks late by 0.03, 0.06, 0, held out 0.02 s",
                     triggered({"slow.csv": 0.03, "fast.csv": 0.06, "wave.csv": 0.0,
                                "held.csv": 0.02}), **_FLAWED),
    "stamps": Case("Giesekus, times rounded to the interval of 0.1 s", recorded(GIESEKUS),
                   stamped(1.0), **_RIGHT),
    "first_warms": Case("Giesekus, the first run begins 3 K too cold",
                        batches({"slow.csv": Settling(GIESEKUS)}), **_FLAWED),
    "evaporates": Case("Giesekus, modulus and time grow by 0.05 and 0.1 % a second",
                       batches({name: Evaporating(GIESEKUS, 12.0 * i, 5e-4, 1e-3)
                                for i, name in enumerate(FLOWS)}), **_FLAWED),
    "sweep_slow": Case("Giesekus in three modes, a sweep up to 2 rad/s",
                       recorded(_THREE, OF_THREE_MODES), same_as=_LINEAR, **_told(0.01, 2.0),
                       **_FLAWED),
    "sweep_fast": Case("Giesekus in three modes, a sweep from 1 rad/s on",
                       recorded(_THREE, OF_THREE_MODES), same_as=_LINEAR, **_told(1.0, 100.0),
                       **_FLAWED),
    "sweep_slow_ptt": Case("exponential PTT in three modes, a sweep up to 2 rad/s",
                           recorded(_THREE_PTT, OF_THREE_MODES), **_told(0.01, 2.0), **_EPSILON),
    "sweep_fast_ptt": Case("exponential PTT in three modes, a sweep from 1 rad/s on",
                           recorded(_THREE_PTT, OF_THREE_MODES), **_told(1.0, 100.0), **_EPSILON),
    "lag_and_slip": Case("Giesekus, a lag of 0.08 s and slip of 6e-4 1/(Pa s)",
                         recorded(GIESEKUS, lag=0.08, slip=6e-4),
                         planted={**MOBILITY, "transducer_lag": {"tau": 0.08},
                                  "wall_slip": {}}, terms=SQUARE, outside=True),
    "gain_and_compliance": Case("Giesekus, a gain of 4 % and a tool of 4e-4 1/Pa",
                                recorded(GIESEKUS, gain=0.04, compliance=4e-4),
                                planted={**MOBILITY, "tool_compliance": {}},
                                same_as=(*_GAINS, _BENCH),
                                terms=SQUARE, outside=True),
    "ramped": Case("Giesekus of 0.05, rates that rise evenly over 0.2 s",
                   ramped(0.2, Giesekus(0.05, **SCALE)),
                   planted={"giesekus_mobility": {"alpha": 0.05}}, terms={"sigma.sigma": 0.05},
                   same_as=("rate_rise_time", "time_delay", "transducer_lag"), outside=True),
    "median": Case("Giesekus, medians of seven samples", recorded(GIESEKUS), median_of(7),
                   **_FLAWED),
    "clipped_little": Case("Giesekus, no stress beyond 104 Pa is recorded",
                           recorded(GIESEKUS, limit=104.0), **_FLAWED),
    "saturating": Case("Giesekus, a transducer that reads 3.6 % less at 100 Pa",
                       each(of_stress(saturating(300.0))), **_FLAWED),
    "cut_cycles": Case("Giesekus, two cycles of the wave cut off, as if from rest",
                       cut_cycles("wave.csv", 2), **_FLAWED),
    "strains": Case("Giesekus, steps of strain that take 0.1 s, told as at once",
                    strains(0.1), model=FITTED, same_as=_LATE, **_FLAWED),
    "strains_told": Case("Giesekus, steps of strain that take 0.1 s, all told as at once",
                         strains(0.1), same_as=(*_GAINS, *_LATE), **_FLAWED),
    "repeats": Case("Giesekus, every fitted run twice, loadings that differ by 4 %",
                    Repeated(GIESEKUS), loaded(0.04), **_FLAWED),
    "repeats_k_bkz": Case("K-BKZ, every fitted run twice, loadings that differ by 4 %",
                          Repeated(KBKZ(0.25, **SCALE)), loaded(0.04), planted=DAMPED,
                          outside=True),
    "repeats_pom_pom": Case("pom-pom, every fitted run twice, loadings that differ by 4 %",
                            Repeated(POM_POM), loaded(0.04), outside=True),
    "far_rolie": Case("Rolie–Poly of stretch time 0.05, fitted up to 1 1/s, held out 10 1/s",
                      recorded(RoliePoly(1.0, 0.05, **SCALE), SLOW_THEN_FASTER), outside=True,
                      same_as=("convective_constraint_release",)),
    "micelles": Case("Bautista–Manero, a fluidity that grows with work", recorded(Micelles()),
                     outside=True),
    "fene_p": Case("FENE-P of 20", recorded(FenePeterlin(20.0, **SCALE)), outside=True,
                   planted={"finite_extensibility": {"q": 0.05}}),
    "many_chains": Case("Rolie–Poly with stretch in three modes, one fitted", recorded(_CHAINS),
                        model=FITTED, outside=True,
                        same_as=("convective_constraint_release", "relaxation_mode")),
    "many_chains_told": Case("Rolie–Poly with stretch in three modes, one told", recorded(_CHAINS),
                             model={**KNOWN, "modulus_Pa": 60.0, "relaxation_time_s": 1.0},
                             outside=True,
                             same_as=("convective_constraint_release", "relaxation_mode")),
}  # fmt: skip

CASES: dict[str, Case] = {**MIXTURES_AND_BEFORE, **BENCHES}
