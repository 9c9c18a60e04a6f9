"""White–Metzner law: a Maxwell fluid whose relaxation time depends on the rate."""

from dataclasses import dataclass

import numpy as np

from independent.material import Rate, StressLaw, rate_tensor, stretched


@dataclass(frozen=True)
class WhiteMetzner(StressLaw):
    """σ + λ(γ̇) σ▽ = G λ(γ̇) γ̇, λ(γ̇) = λ/(1 + (k λ|γ̇|)^{1−n}).

    [White & Metzner 1963, J. Appl. Polym. Sci. 7, 1867; Cross's function of the rate]
    """

    exponent: float = 0.5  # n
    factor: float = 1.0  # k
    modulus: float = 1.0
    relaxation_time: float = 1.0

    def time_at(self, rate: Rate) -> float:
        """Return λ(γ̇) in s."""
        size = np.sqrt(np.sum(rate_tensor(rate) ** 2) / 2)  # |γ̇| of any flow
        thinning = (self.factor * self.relaxation_time * size) ** (1 - self.exponent)
        return self.relaxation_time / (1 + thinning)

    def stress_change(self, stress: np.ndarray, rate: Rate) -> np.ndarray:
        """Return dσ/dt."""
        production = self.modulus * rate_tensor(rate) + stretched(stress, rate)
        return production - stress / self.time_at(rate)
