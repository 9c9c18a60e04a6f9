"""Upper-convected Maxwell law and the Newtonian solvent."""

from dataclasses import dataclass

import numpy as np

from independent.flow import Flow
from independent.material import Rate, RateLaw, Stresses, StressLaw, rate_tensor, stretched


@dataclass(frozen=True)
class UpperConvectedMaxwell(StressLaw):
    """σ + λ σ▽ = G λ γ̇   [Oldroyd 1950, Proc. R. Soc. A 200, 523]."""

    modulus: float = 1.0  # G, Pa
    relaxation_time: float = 1.0  # λ, s

    def stress_change(self, stress: np.ndarray, rate: Rate) -> np.ndarray:
        """Return dσ/dt."""
        return (
            self.modulus * rate_tensor(rate)
            + stretched(stress, rate)
            - stress / self.relaxation_time
        )

    def start_up(self, rate: float, times: np.ndarray) -> Stresses:
        """Return start-up in closed form   [Bird, Armstrong & Hassager 1987, vol. 1, ch. 7]."""
        t = np.asarray(times) / self.relaxation_time
        weissenberg = rate * self.relaxation_time
        shear = self.modulus * weissenberg * -np.expm1(-t)
        first = 2 * self.modulus * weissenberg**2 * (1 - np.exp(-t) * (1 + t))
        return Stresses(shear, first, np.zeros_like(shear))


@dataclass(frozen=True)
class Newtonian(RateLaw):
    """σ = η γ̇: a solvent, to stand among `Modes`."""

    viscosity: float = 1.0  # η, Pa s
    modulus: float = 0.0

    def rest(self) -> np.ndarray:
        """Return no state."""
        return np.zeros(0)

    def change(self, state: np.ndarray, rate: float) -> np.ndarray:
        """Return nothing."""
        del rate
        return state

    def stress(self, state: np.ndarray, rate: float) -> np.ndarray:
        """Return η γ̇."""
        del state
        return self.viscosity * rate_tensor(rate)

    def respond(self, flow: Flow, times: np.ndarray) -> Stresses:
        """Return η γ̇ and no normal stresses."""
        shear = self.viscosity * np.asarray(flow.rate(np.asarray(times)), float)
        return Stresses(shear, np.zeros_like(shear), np.zeros_like(shear))
