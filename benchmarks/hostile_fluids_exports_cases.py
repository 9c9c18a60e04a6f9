"""What exports and transducers do, and what is true of it."""

from dataclasses import replace

from hostile_fluids_cases import (
    LABORATORY_AND_BEFORE,
    OF_THREE_MODES,
    THREE_MODULI,
    THREE_TIMES,
    TOLD_BY_SWEEP,
)
from hostile_fluids_exports import (
    averaged_since,
    banded,
    cooled,
    dried,
    from_time,
    held_and_rounded,
    interpolated,
    of_stress,
    on_instruments,
    range_switch,
    share_and_floor,
    twice,
    with_strain,
    without,
)
from hostile_fluids_laboratory import averaged, each, sweep_of
from hostile_fluids_materials import Heated
from hostile_fluids_records import FLOWS, GIESEKUS, MOBILITY, SCALE, SQUARE, Case, only, recorded
from independent import Giesekus, JohnsonSegalman, Modes, start_up

_ALONE = {"planted": MOBILITY, "terms": SQUARE}
_ALSO_GIESEKUS = {"outside": True, "same_as": ("giesekus_mobility",)}
_TIMES = ("relaxation_time_factor", "relaxation_time_s", "wall_slip", "sigma", "tool_compliance")
_BANDED = JohnsonSegalman(0.3, **SCALE)
_THREE = Modes(*(Giesekus(0.3, g, t) for g, t in zip(THREE_MODULI, THREE_TIMES, strict=True)))
EXPORTS = {
    "averaged_since": Case("Giesekus, means over the last 0.5 s told", averaged_since(0.5),
                           **_ALSO_GIESEKUS),
    "averaged_late": Case("Giesekus, means over 0.5 s told, from 0.8 s on",
                          from_time(averaged(0.5), 0.8), **_ALSO_GIESEKUS),
    "averaged_little": Case("Giesekus, means over 0.2 s told", averaged(0.2), **_ALSO_GIESEKUS),
    "lag": Case("Giesekus, a lag of 0.1 s", recorded(GIESEKUS, lag=0.1),
                planted={**MOBILITY, "transducer_lag": {"tau": 0.1}},
                same_as=("time_delay", "rate_rise_time")),
    "phase": Case("Giesekus, the wave told 0.1 s late",
                  on_instruments({"wave.csv": {"delay": 0.1}}), **_ALSO_GIESEKUS),
    "interpolated": Case("Giesekus, every fourth of the samples, straight lines between",
                         recorded(GIESEKUS), interpolated(4), **_ALONE),
    "clipped": Case("Giesekus, one run beyond the transducer's limit",
                    on_instruments({"fast.csv": {"limit": 85.0}}), **_ALSO_GIESEKUS),
    "range_switch": Case("Giesekus, 2 % more above 50 Pa", each(of_stress(range_switch(0.02))),
                         **_ALSO_GIESEKUS),
    "strain_offset": Case("Giesekus, strain told with an offset of 0.05",
                          each(with_strain(0.05)), **_ALONE),
    "two_geometries": Case("Giesekus, two of four runs at a rate 4 % higher than told",
                           on_instruments({"fast.csv": {"rate_gain": 0.04},
                                           "held.csv": {"rate_gain": 0.04}}), **_ALSO_GIESEKUS),
    "dried": Case("Giesekus that dries, 2 % in ten seconds, run after run",
                  each(of_stress(dried)), **_ALSO_GIESEKUS),
    "cooled": Case("Giesekus, its modulus rises by 5 % in each run", each(of_stress(cooled)),
                   **_ALSO_GIESEKUS),
    "mode_missing": Case("Giesekus in three modes, two told", recorded(_THREE, OF_THREE_MODES),
                         tables=sweep_of(THREE_MODULI[:2], THREE_TIMES[:2]), model=TOLD_BY_SWEEP,
                         outside=True, same_as=("giesekus_mobility", "relaxation_mode")),
    "other_temperature": Case("Giesekus in three modes, all times told 25 % long",
                              recorded(_THREE, OF_THREE_MODES),
                              tables=sweep_of(THREE_MODULI, tuple(1.25 * t for t in THREE_TIMES)),
                              model=TOLD_BY_SWEEP, outside=True,
                              same_as=("giesekus_mobility", *_TIMES)),
    "held_and_rounded": Case("Giesekus, every second value that before it, three digits",
                             recorded(GIESEKUS), held_and_rounded(), **_ALONE),
    "share_and_floor": Case("Giesekus, noise of 2 % of each value and 0.5 Pa",
                            recorded(GIESEKUS), share_and_floor(0.02, 0.5), **_ALONE),
    "banded": Case("Johnson–Segalman in bands, a flow curve and a start-up",
                   only("held.csv", _BANDED), tables=banded(_BANDED),
                   outside=True, same_as=("non_affine_motion", "solvent_viscosity")),
    "twice": Case("Giesekus, a run repeated", twice("fast.csv"), **_ALONE),
    "piece_lost": Case("Giesekus, a second of two runs lost",
                       each(without(1.0, 2.0, ("fast.csv", "wave.csv"))), **_ALONE),
    "weak": Case("Giesekus of 0.02", recorded(Giesekus(0.02, **SCALE)),
                 planted={"giesekus_mobility": {"alpha": 0.02}}, terms={"sigma.sigma": 0.02}),
    "strong": Case("Giesekus of 0.8", recorded(Giesekus(0.8, **SCALE)),
                   planted={"giesekus_mobility": {"alpha": 0.8}}, terms={"sigma.sigma": 0.8}),
}  # fmt: skip


# flaws that change σ12 by one or two times its noise of 1 %, which tests of the residual hardly see
LITTLE = {
    "little_lag": Case("Giesekus, a lag of 0.03 s", recorded(GIESEKUS, lag=0.03),
                       planted={**MOBILITY, "transducer_lag": {"tau": 0.03}},
                       same_as=("time_delay", "rate_rise_time"), terms=SQUARE),
    "little_rise": Case("Giesekus, a motor that takes 0.03 s", recorded(GIESEKUS, rise_time=0.03),
                        planted={**MOBILITY, "rate_rise_time": {"tau": 0.03}},
                        same_as=("time_delay", "transducer_lag"), terms=SQUARE),
    "little_drift": Case("Giesekus, 0.3 Pa/s of drift", recorded(GIESEKUS, drift=0.3),
                         planted={**MOBILITY, "stress_drift": {"drift": 0.3}}, terms=SQUARE),
    "little_offset": Case("Giesekus and 1 Pa", recorded(GIESEKUS, offset=1.0),
                          planted={**MOBILITY, "stress_offset": {"offset": 1.0}}, terms=SQUARE),
    "little_slip": Case("Giesekus, slip of 2e-4 1/(Pa s)", recorded(GIESEKUS, slip=2e-4),
                        planted={**MOBILITY, "wall_slip": {}}, same_as=_TIMES, terms=SQUARE),
    "little_compliance": Case("Giesekus, a tool of 3e-4 1/Pa", recorded(GIESEKUS, compliance=3e-4),
                              planted={**MOBILITY, "tool_compliance": {}}, terms=SQUARE),
    "little_heat": Case("Giesekus that warms a little", recorded(Heated(0.3, 0.0001)),
                        outside=True, same_as=("viscous_heating", "giesekus_mobility"),
                        terms=SQUARE),
    "little_range": Case("Giesekus, 1 % more above 50 Pa",
                         each(of_stress(range_switch(0.01))), terms=SQUARE, **_ALSO_GIESEKUS),
}  # fmt: skip

# the same where the run held out asks for no rate that was not fitted
_WITHIN = {**FLOWS, "held.csv": (start_up(1.2), FLOWS["held.csv"][1])}
WITHIN = {
    "within_averaged": Case("Giesekus, means over 0.5 s told, held out within",
                            averaged(0.5, flows=_WITHIN), terms=SQUARE, **_ALSO_GIESEKUS),
    "within_averaged_little": Case("Giesekus, means over 0.3 s told, held out within",
                                   averaged(0.3, flows=_WITHIN), terms=SQUARE, **_ALSO_GIESEKUS),
    "within_lag": Case("Giesekus, a lag of 0.03 s, held out within",
                       recorded(GIESEKUS, _WITHIN, lag=0.03), terms=SQUARE,
                       planted={**MOBILITY, "transducer_lag": {"tau": 0.03}},
                       same_as=("time_delay", "rate_rise_time")),
    "within_compliance": Case("Giesekus, a tool of 3e-4 1/Pa, held out within",
                              recorded(GIESEKUS, _WITHIN, compliance=3e-4), terms=SQUARE,
                              planted={**MOBILITY, "tool_compliance": {}}),
    "within_offset": Case("Giesekus and 1 Pa, held out within",
                          recorded(GIESEKUS, _WITHIN, offset=1.0), terms=SQUARE,
                          planted={**MOBILITY, "stress_offset": {"offset": 1.0}}),
    "within_drift": Case("Giesekus, 0.3 Pa/s of drift, held out within",
                         recorded(GIESEKUS, _WITHIN, drift=0.3), terms=SQUARE,
                         planted={**MOBILITY, "stress_drift": {"drift": 0.3}}),
    "within_slip": Case("Giesekus, slip of 2e-4 1/(Pa s), held out within",
                        recorded(GIESEKUS, _WITHIN, slip=2e-4), terms=SQUARE,
                        planted={**MOBILITY, "wall_slip": {}}, same_as=_TIMES),
    "within_rounded_mean": Case("Giesekus, every fourth sample, straight lines, held out within",
                                recorded(GIESEKUS, _WITHIN), interpolated(4), **_ALONE),
}  # fmt: skip

# and where no run is held out
NONE_HELD_OUT = {
    f"all_{name}": replace(case, held_out=())
    for name, case in {**LITTLE, **{n: EXPORTS[n] for n in ("averaged_little", "cooled")}}.items()
}

EXPORTS_AND_BEFORE: dict[str, Case] = {
    **LABORATORY_AND_BEFORE, **EXPORTS, **LITTLE, **WITHIN, **NONE_HELD_OUT,
}  # fmt: skip
