"""Linear and exponential Phan-Thien–Tanner laws with slip of the network."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from independent.material import Rate, StressLaw, rate_tensor, stretched


@dataclass(frozen=True)
class PhanThienTanner(StressLaw):
    """Y(tr σ) σ + λ σ□ = G λ γ̇, σ□ = σ▽ + (ξ/2)(γ̇·σ + σ·γ̇).

    Y = 1 + (ε/G) tr σ   [Phan-Thien & Tanner 1977, JNNFM 2, 353] or
    Y = exp((ε/G) tr σ)   [Phan-Thien 1978, J. Rheol. 22, 259].
    """

    extensibility: float = 0.2  # ε
    kind: Literal["linear", "exponential"] = "linear"
    slip: float = 0.0  # ξ
    modulus: float = 1.0
    relaxation_time: float = 1.0

    def stress_change(self, stress: np.ndarray, rate: Rate) -> np.ndarray:
        """Return dσ/dt."""
        argument = self.extensibility * np.trace(stress) / self.modulus
        factor = 1 + argument if self.kind == "linear" else np.exp(argument)
        deformation = rate_tensor(rate)
        product = deformation @ stress
        return (
            self.modulus * deformation
            + stretched(stress, rate)
            - 0.5 * self.slip * (product + product.T)
            - factor * stress / self.relaxation_time
        )
