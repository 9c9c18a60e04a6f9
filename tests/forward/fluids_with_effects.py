"""Fluids and instruments with effects, by materials that know nothing of the package's effects."""

from dataclasses import dataclass

import numpy as np
from independent import (
    Giesekus,
    Modes,
    Newtonian,
    PhanThienTanner,
    RateLaw,
    StressLaw,
    Thixotropic,
    UpperConvectedMaxwell,
)
from independent.instruments import Instrument
from independent.material import rate_tensor, stretched
from readers import sum_of_spelled

FAULTS = {
    "wall_slip": "slip", "rate_rise_time": "rise_time", "transducer_lag": "lag",
    "bearing_friction": "friction", "rate_gain": "rate_gain",
}  # fmt: skip


@dataclass(frozen=True)
class Warmed(RateLaw):
    """A law whose relaxation its own work quickens: dΘ/dt = b σ:D − Θ/t_h, λ → λ e^−Θ."""

    law: RateLaw
    heating: float  # b, 1/Pa
    loss_time: float  # t_h, s

    @property
    def modulus(self):
        return self.law.modulus

    def rest(self):
        return np.append(0.0, self.law.rest())

    def scale(self):
        return np.append(1.0, self.law.scale())

    def change(self, state, rate):
        warm, own = state[0], state[1:]
        work = 0.5 * np.sum(self.law.stress(own, rate) * rate_tensor(rate))
        # what a law changes by where nothing flows is its relaxation
        moved = self.law.change(own, rate) + np.expm1(warm) * self.law.change(own, 0.0)
        return np.append(self.heating * work - warm / self.loss_time, moved)

    def stress(self, state, rate):
        return self.law.stress(state[1:], rate)


@dataclass(frozen=True)
class WithTerms(StressLaw):
    """Upper-convected Maxwell with terms of the library, read from their spelling."""

    terms: dict[str, float]
    modulus: float
    relaxation_time: float

    def stress_change(self, stress, rate):
        twice, time = rate_tensor(rate), self.relaxation_time
        told = [(name, value, {}) for name, value in self.terms.items()]
        extra = stress + self.modulus * sum_of_spelled(told, stress / self.modulus, time * twice)
        return self.modulus * twice + stretched(stress, rate) - extra / time


def effects_in(model, theta, names):
    """Return the values of the effects that a vector has, by name."""
    values = {name: theta[model.positions(name)].tolist() for name in names}
    return {name: of for name, of in values.items() if of[0] != 0.0}


def fluid_with(effects, modes, solvent=0.0):
    """Return the fluid of modes, pairs of Pa and s, that has those effects that are of a fluid."""
    law, constants = UpperConvectedMaxwell, ()
    if "giesekus_mobility" in effects:
        law, constants = Giesekus, effects["giesekus_mobility"]
    if "ptt_exponential" in effects:
        law, constants = PhanThienTanner, (*effects["ptt_exponential"], "exponential", 0.0)
    if terms := {name: value for name, (value, *_) in effects.items() if "*" in name}:
        law, constants = WithTerms, (terms,)
    fluid = Modes(*(law(*constants, *mode) for mode in modes))
    if "relaxation_mode" in effects:
        fluid = Modes(fluid, UpperConvectedMaxwell(*effects["relaxation_mode"]))
    if "viscous_heating" in effects:
        fluid = Warmed(fluid, *effects["viscous_heating"])
    if "thixotropy" in effects:
        fluid = Thixotropic(fluid, *effects["thixotropy"])
    return Modes(fluid, Newtonian(solvent)) if solvent else fluid


def instrument_with(effects):
    """Return the instrument that has those effects that are of an instrument."""
    return Instrument(**{FAULTS[name]: of[0] for name, of in effects.items() if name in FAULTS})
