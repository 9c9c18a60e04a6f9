"""A soft glass: its rate of relaxation falls with age at rest, and flow makes it young again."""

from dataclasses import dataclass

import numpy as np

from independent.material import Rate, RateLaw, rate_tensor, stretched


@dataclass(frozen=True)
class SoftGlass(RateLaw):
    """σ▽ = G γ̇ − D σ, dD/dt = −r D² + u |γ̇|², D = 1/λ at first.

    A Landau expansion of the rate of relaxation after Derec, Ajdari & Lequeux 2001, Eur. Phys. J. E
    4, 355; the powers and the tensor form are a choice made here. At rest D = 1/(λ + r t), so that
    the relaxation time grows with the age. In steady flow D = √(u/r) |γ̇|: the stress ends at the
    yield stress G √(r/u).
    """

    ageing: float = 0.2  # r
    rejuvenation: float = 0.2  # u
    modulus: float = 1.0
    relaxation_time: float = 1.0

    def rest(self) -> np.ndarray:
        """Return D = 1/λ and no stress."""
        return np.append(1.0 / self.relaxation_time, np.zeros(9))

    def scale(self) -> np.ndarray:
        """Return 1/λ, and the modulus nine times."""
        return np.append(1.0 / self.relaxation_time, np.full(9, self.modulus))

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return dD/dt and dσ/dt."""
        relaxing, stress = state[0], state[1:].reshape(3, 3)
        intensity = np.sum(rate_tensor(rate) ** 2) / 2
        young = -self.ageing * relaxing**2 + self.rejuvenation * intensity
        driven = self.modulus * rate_tensor(rate) + stretched(stress, rate)
        return np.append(young, driven - relaxing * stress)

    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return σ."""
        del rate
        return state[1:].reshape(3, 3)
