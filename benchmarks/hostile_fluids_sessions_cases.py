"""What a session in the laboratory does, and what is true of it; and every case together."""

from hostile_fluids_cases import OF_THREE_MODES, THREE_MODULI, THREE_TIMES, TOLD_BY_SWEEP
from hostile_fluids_exports import of_stress, on_instruments, range_switch
from hostile_fluids_exports_cases import EXPORTS_AND_BEFORE
from hostile_fluids_laboratory import each, sweep_of, times_stress, warmed
from hostile_fluids_materials import white
from hostile_fluids_records import (
    DAMPED,
    FITTED,
    FLOWS,
    GIESEKUS,
    KNOWN,
    MOBILITY,
    ONE_HELD,
    POM_POM,
    SCALE,
    SQUARE,
    Case,
    recorded,
)
from hostile_fluids_sessions import (
    at_zero,
    between,
    by_largest,
    copied,
    filled_up,
    grown,
    interpolated_onto,
    moving_mean,
    of_blocks,
    partly_broken,
    recorded_again,
    splined,
    without_wave,
)
from independent import KBKZ, Giesekus, Modes, RoliePoly

_RIGHT = {"planted": MOBILITY, "terms": SQUARE}
_FLAWED = {"planted": MOBILITY, "terms": SQUARE, "outside": True}
_TWO = Modes(Giesekus(0.1, 60.0, 3.0), Giesekus(0.5, 80.0, 0.4))
_THREE = Modes(*(Giesekus(0.3, g, t) for g, t in zip(THREE_MODULI, THREE_TIMES, strict=True)))
_OTHER_MODES = {"outside": True, "same_as": ("giesekus_mobility", "relaxation_mode")}
_STARTS = without_wave()
_CUT = {
    name: (flow, times[: {"fast.csv": 10, "wave.csv": 30}.get(name)])
    for name, (flow, times) in FLOWS.items()
}


def _sweep(*factors: float):
    moduli = tuple(f * g for f, g in zip(factors, THREE_MODULI, strict=True))
    return {"tables": sweep_of(moduli, THREE_TIMES), "model": TOLD_BY_SWEEP}


SESSIONS = {
    "two_own": Case("Giesekus, two modes of 0.1 and 0.5, one told", recorded(_TWO),
                    model={**KNOWN, "modulus_Pa": 60.0, "relaxation_time_s": 3.0}, **_OTHER_MODES),
    "two_own_fitted": Case("Giesekus, two modes of 0.1 and 0.5, one fitted", recorded(_TWO),
                           model=FITTED, **_OTHER_MODES),
    "spectrum_right": Case("Giesekus in three modes, rightly told",
                           recorded(_THREE, OF_THREE_MODES), **_sweep(1.0, 1.0, 1.0), **_RIGHT),
    "spectrum_slow": Case("Giesekus in three modes, the slowest told 10 % high",
                          recorded(_THREE, OF_THREE_MODES), **_sweep(1.1, 1.0, 1.0), **_FLAWED),
    "spectrum_middle": Case("Giesekus in three modes, the middle one told 10 % high",
                            recorded(_THREE, OF_THREE_MODES), **_sweep(1.0, 1.1, 1.0), **_FLAWED),
    "spectrum_fast": Case("Giesekus in three modes, the fastest told 10 % high",
                          recorded(_THREE, OF_THREE_MODES), **_sweep(1.0, 1.0, 1.1), **_FLAWED),
    "dries": Case("Giesekus that dries, 0.1 to 0.4 % a second, by run",
                  each(grown({"slow.csv": 1e-3, "fast.csv": 2e-3, "wave.csv": 3e-3,
                              "held.csv": 4e-3})), **_FLAWED),
    "dries_fast": Case("Giesekus that dries, 0.4 to 1 % a second, by run",
                       each(grown({"slow.csv": 4e-3, "fast.csv": 6e-3, "wave.csv": 8e-3,
                                   "held.csv": 1e-2})), **_FLAWED),
    "edge_partly": Case("Giesekus, an edge that loses 3 % beyond a strain of 8",
                        each(partly_broken(0.03, 8.0)), **_FLAWED),
    "edge": Case("Giesekus, an edge that loses 8 % beyond a strain of 8",
                 each(partly_broken(0.08, 8.0)), **_FLAWED),
    "one_kelvin": Case("Giesekus, times of 1, 1.02, 0.98, held 1.01 s",
                       warmed({"slow.csv": 1.0, "fast.csv": 1.02, "wave.csv": 0.98,
                               "held.csv": 1.01}), **_FLAWED),
    "three_kelvin": Case("Giesekus, times of 0.95, 1.05, 1, held 1.03 s",
                         warmed({"slow.csv": 0.95, "fast.csv": 1.05, "wave.csv": 1.0,
                                 "held.csv": 1.03}), **_FLAWED),
    "rolie_noisy": Case("stretching Rolie–Poly, 6 % noise",
                        recorded(RoliePoly(1.0, 0.1, **SCALE)), white(0.06), outside=True,
                        same_as=("convective_constraint_release", "ptt_linear", "tr(sigma)*I")),
    "rate_of_one": Case("Giesekus, one rate 2 % higher than told",
                        on_instruments({"fast.csv": {"rate_gain": 0.02}}), **_FLAWED),
    "rate_of_slow": Case("Giesekus, the slow rate 2 % higher than told",
                         on_instruments({"slow.csv": {"rate_gain": 0.02}}), **_FLAWED),
    "rate_of_wave": Case("Giesekus, the wave's rate 2 % higher than told",
                         on_instruments({"wave.csv": {"rate_gain": 0.02}}), **_FLAWED),
    "filled": Case("Giesekus, gaps filled by 1, 1.01, 0.99, held 1.005",
                   each(times_stress({"fast.csv": 1.01, "wave.csv": 0.99, "held.csv": 1.005})),
                   **_FLAWED),
    "zeros": Case("Giesekus, zeros of 0.5, −0.5, 0.3, held −0.3 Pa",
                  each(at_zero({"slow.csv": 0.5, "fast.csv": -0.5, "wave.csv": 0.3,
                                "held.csv": -0.3})), **_FLAWED),
    "splined": Case("Giesekus, smoothed by a spline", recorded(GIESEKUS), splined(), **_FLAWED),
    "smoothed": Case("Giesekus, means of five samples", recorded(GIESEKUS), moving_mean(5),
                     **_FLAWED),
    "resampled": Case("Giesekus, exported evenly in log t", interpolated_onto(60, flows=_STARTS),
                      between(60), **_FLAWED),
    "decimated": Case("Giesekus, means of eight samples each", of_blocks(8), **_RIGHT),
    "normalised": Case("Giesekus, each stress over its largest, times 100",
                       each(by_largest()), **_FLAWED),
    "normalised_one": Case("Giesekus, one stress over its largest, times 100",
                           each(by_largest(("fast.csv",))), **_FLAWED),
    "copied": Case("Giesekus, one run under two names", recorded(GIESEKUS),
                   export=copied("fast.csv", "again.csv"), **_RIGHT),
    "rounded_copy": Case("Giesekus, one run under two names, once of three digits",
                         recorded(GIESEKUS), export=recorded_again("fast.csv", "again.csv"),
                         **_RIGHT),
    "copy_held": Case("K-BKZ, the run held out is one of those fitted",
                      recorded(KBKZ(0.25, **SCALE)), planted=DAMPED, outside=True,
                      export=copied("fast.csv", "held.csv")),
    "copy_held_pom_pom": Case("pom-pom, one start-up, held out the same",
                              recorded(POM_POM, ONE_HELD), outside=True,
                              export=copied("only.csv", "held.csv")),
    "truncated": Case("Giesekus, two runs that end after 1 and 3 s", recorded(GIESEKUS, _CUT),
                      **_RIGHT),
    "filled_last": Case("Giesekus, one run that ends after 4 s, filled with its last value",
                        recorded(GIESEKUS), export=filled_up(4.0, ("fast.csv",), True), **_FLAWED),
    "filled_zero": Case("Giesekus, one run that ends after 4 s, filled with zeros",
                        recorded(GIESEKUS), export=filled_up(4.0, ("fast.csv",), False),
                        **_FLAWED),
    "range_half": Case("Giesekus, 0.5 % more above 50 Pa", each(of_stress(range_switch(0.005))),
                       **_FLAWED),
}  # fmt: skip

CASES: dict[str, Case] = {**EXPORTS_AND_BEFORE, **SESSIONS}
