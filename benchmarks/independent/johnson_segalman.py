"""Johnson–Segalman law."""

from dataclasses import dataclass

import numpy as np

from independent.material import Rate, StressLaw, rate_tensor, velocity_gradient


@dataclass(frozen=True)
class JohnsonSegalman(StressLaw):
    """σ + λ(dσ/dt − ω·σ + σ·ω − a(D·σ + σ·D)) = 2 G λ D   [Johnson & Segalman 1977, JNNFM 2, 255].

    Written with vorticity ω = (L − Lᵀ)/2, D = (L + Lᵀ)/2 and a = 1 − ξ.
    """

    slip: float = 0.4  # ξ
    modulus: float = 1.0
    relaxation_time: float = 1.0

    def stress_change(self, stress: np.ndarray, rate: Rate) -> np.ndarray:
        """Return dσ/dt."""
        gradient = velocity_gradient(rate)
        vorticity = (gradient - gradient.T) / 2
        deformation = rate_tensor(rate) / 2
        turned = vorticity @ stress - stress @ vorticity
        carried = (1 - self.slip) * (deformation @ stress + stress @ deformation)
        return 2 * self.modulus * deformation + turned + carried - stress / self.relaxation_time

    def start_up(self, rate: float, times: np.ndarray) -> np.ndarray:
        """Return σ12 in start-up in closed form, in Pa.

        σ12 and N1 are a damped oscillation of frequency γ̇√(1 − a²) about steady shear.
        """
        t = np.asarray(times) / self.relaxation_time
        weissenberg = rate * self.relaxation_time
        w = weissenberg * np.sqrt(1 - (1 - self.slip) ** 2)
        steady = weissenberg / (1 + w**2)
        return self.modulus * steady * (1 - np.exp(-t) * (np.cos(w * t) - w * np.sin(w * t)))
