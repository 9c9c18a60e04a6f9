"""Fluids of two modes, of two batches, and what a unit or a gain does; and every case together."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from hostile_fluids_exports import of_stress
from hostile_fluids_laboratory import each
from hostile_fluids_records import (
    FITTED,
    FLOWS,
    GIESEKUS,
    KNOWN,
    MOBILITY,
    SCALE,
    SQUARE,
    UCM,
    Case,
    Record,
    alternating,
    recorded,
)
from hostile_fluids_sessions_cases import CASES as SESSIONS_AND_BEFORE
from independent import Giesekus, Modes, PhanThienTanner, Thixotropic, WhiteMetzner
from independent.material import Rate, RateLaw, rate_tensor

MODULI, TIMES = (60.0, 80.0), (3.0, 0.4)
_FLAWED = {"planted": MOBILITY, "terms": SQUARE, "outside": True}
_BY_MODE = {"outside": True, "same_as": ("giesekus_mobility", "relaxation_mode")}
_BY_MODE_PTT = {"outside": True, "same_as": ("ptt_linear", "relaxation_mode")}


def two_modes(first: float, second: float) -> Modes:
    """Return a Giesekus fluid of two modes with these mobilities."""
    return Modes(*(Giesekus(a, g, t) for a, g, t in zip((first, second), MODULI, TIMES,
                                                        strict=True)))  # fmt: skip


def two_of_ptt(first: float, second: float) -> Modes:
    """Return a fluid of two modes of linear Phan-Thien–Tanner with these extensibilities."""
    return Modes(*(PhanThienTanner(e, modulus=g, relaxation_time=t)
                   for e, g, t in zip((first, second), MODULI, TIMES, strict=True)))  # fmt: skip


class CarreauWhiteMetzner(WhiteMetzner):
    """White–Metzner with λ(γ̇) = λ (1 + (k λ γ̇)²)^((n − 1)/2)   [Carreau 1972]."""

    def time_at(self, rate: Rate) -> float:
        """Return λ(γ̇) in s."""
        size = np.sqrt(np.sum(rate_tensor(rate) ** 2) / 2)
        of_rate = 1 + (self.factor * self.relaxation_time * size) ** 2
        return self.relaxation_time * of_rate ** ((self.exponent - 1) / 2)


@dataclass(frozen=True)
class Thickening(RateLaw):
    """A viscous stress η γ̇ (1 + |γ̇|/γ̇_c), to stand among `Modes`."""

    viscosity: float = 2.0  # η, Pa s
    rate: float = 1.0  # γ̇_c, 1/s
    modulus: float = 0.0

    def rest(self) -> np.ndarray:
        """Return no state."""
        return np.zeros(0)

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return nothing."""
        del rate
        return state

    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return η γ̇ (1 + |γ̇|/γ̇_c)."""
        del state
        tensor = rate_tensor(rate)
        size = np.sqrt(np.sum(tensor**2) / 2)
        return self.viscosity * (1 + size / self.rate) * tensor


def batches(fluids: Mapping[str, RateLaw]) -> Callable[[], dict[str, Record]]:
    """Return the maker of runs of a Giesekus fluid, some of them of another batch, by name."""

    def make() -> dict[str, Record]:
        return {
            name: recorded(fluids.get(name, GIESEKUS), {name: flow})()[name]
            for name, flow in FLOWS.items()
        }

    return make


def in_minutes(name: str, run: Record) -> Record:
    """Return the record of the fast run with its times in minutes."""
    if name != "fast.csv":
        return run
    return replace(run, columns={**run.columns, "time_s": run.columns["time_s"] / 60.0})


def gain_by_decade(name: str, time: np.ndarray, stress: np.ndarray) -> np.ndarray:
    """Return a stress that each range of the torque, a decade wide, reads 2 % higher."""
    del name, time
    return stress * (1 + 0.02 * np.floor(np.log10(np.maximum(np.abs(stress), 1.0))))


MIXTURES = {
    "two_own_other": Case("Giesekus, two modes of 0.4 and 0.05, one fitted",
                          recorded(two_modes(0.4, 0.05)), model=FITTED, **_BY_MODE),
    "two_of_ptt": Case("linear PTT, two modes of 0.4 and 0.05, one fitted",
                       recorded(two_of_ptt(0.4, 0.05)), model=FITTED, **_BY_MODE_PTT),
    "two_alike": Case("Giesekus, two modes of 0.3, one fitted", recorded(two_modes(0.3, 0.3)),
                      planted=MOBILITY, same_as=("relaxation_mode",), model=FITTED),
    "two_thixotropic": Case("Giesekus, two modes of 0.3 with a structure, one fitted",
                            recorded(Thixotropic(two_modes(0.3, 0.3), 0.07, 3.0)),
                            planted={**MOBILITY, "thixotropy": {"breakdown": 0.07,
                                                                "build_up_time": 3.0}},
                            same_as=("relaxation_mode",), model=FITTED),
    "two_own_thixotropic": Case("Giesekus, two modes of 0.1 and 0.5 with a structure, one fitted",
                                recorded(Thixotropic(two_modes(0.1, 0.5), 0.1, 4.0)),
                                planted={"thixotropy": {"breakdown": 0.1, "build_up_time": 4.0}},
                                model=FITTED, **_BY_MODE),
    "two_slip": Case("Giesekus, two modes of 0.3 that slip, one fitted",
                     recorded(two_modes(0.3, 0.3), slip=1e-3),
                     planted={**MOBILITY, "wall_slip": {}}, same_as=("relaxation_mode",),
                     model=FITTED),
    "two_own_slip": Case("Giesekus, two modes of 0.1 and 0.5 that slip, one fitted",
                         recorded(two_modes(0.1, 0.5), slip=1e-3), planted={"wall_slip": {}},
                         model=FITTED, **_BY_MODE),
    "two_alternation": Case("Giesekus, two modes of 0.1 and 0.5 in steady alternation, one fitted",
                            alternating(two_modes(0.1, 0.5)), model=FITTED, **_BY_MODE),
    "carreau": Case("White–Metzner by Carreau",
                    recorded(CarreauWhiteMetzner(0.5, 1.0, **SCALE)), outside=True),
    "thickening": Case("Maxwell in a liquid that thickens", recorded(Modes(UCM, Thickening())),
                       outside=True, same_as=("solvent_viscosity",)),
    "minutes": Case("Giesekus, one run in minutes", each(in_minutes), **_FLAWED),
    "batch": Case("Giesekus, one run of a batch of 0.33",
                  batches({"fast.csv": Giesekus(0.33, **SCALE)}), **_FLAWED),
    "batch_modulus": Case("Giesekus, one run of a batch of 103 Pa and 0.97 s",
                          batches({"fast.csv": Giesekus(0.3, 103.0, 0.97)}), **_FLAWED),
    "gain_by_decade": Case("Giesekus, 2 % more for each decade of stress",
                           each(of_stress(gain_by_decade)), model=KNOWN, **_FLAWED),
}  # fmt: skip

CASES: dict[str, Case] = {**SESSIONS_AND_BEFORE, **MIXTURES}
