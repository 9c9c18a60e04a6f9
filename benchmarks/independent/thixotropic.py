"""A fluid whose stress is in proportion to a structure that flow breaks and rest mends."""

from dataclasses import dataclass

import numpy as np

from independent.material import RateLaw


@dataclass(frozen=True)
class Thixotropic(RateLaw):
    """σ = s σ_law, ds/dt = (1 − s)/t_b − k |γ̇|^m s^p, s = 1 at rest.

    m = p = 1 is Moore 1959, Trans. Br. Ceram. Soc. 58, 470; others as in Mewis & Wagner 2009, Adv.
    Colloid Interface Sci. 147–148, 214, table 1.
    """

    law: RateLaw
    breakdown: float = 0.1  # k, s^(m−1)
    build_up_time: float = 10.0  # t_b, s
    rate_power: float = 1.0  # m
    structure_power: float = 1.0  # p

    @property
    def modulus(self) -> float:
        """Modulus of the law, in Pa."""
        return self.law.modulus

    def rest(self) -> np.ndarray:
        """Return s = 1 and the law at rest."""
        return np.append(1.0, self.law.rest())

    def scale(self) -> np.ndarray:
        """Return 1 for the structure, and the law's scales."""
        return np.append(1.0, self.law.scale())

    def change(self, state: np.ndarray, rate: float) -> np.ndarray:
        """Return ds/dt and the change of the law's state."""
        s = max(state[0], 0.0)
        broken = self.breakdown * abs(rate) ** self.rate_power * s**self.structure_power
        return np.append((1 - s) / self.build_up_time - broken, self.law.change(state[1:], rate))

    def stress(self, state: np.ndarray, rate: float) -> np.ndarray:
        """Return s σ_law."""
        return state[0] * self.law.stress(state[1:], rate)
