"""Giesekus law, with one mode or a mobility for each mode."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from independent.material import Modes, Rate, StressLaw, rate_tensor, stretched


@dataclass(frozen=True)
class Giesekus(StressLaw):
    """σ + λ σ▽ + (α/G) σ·σ = G λ γ̇   [Giesekus 1982, JNNFM 11, 69]."""

    mobility: float = 0.2  # α
    modulus: float = 1.0
    relaxation_time: float = 1.0

    def stress_change(self, stress: np.ndarray, rate: Rate) -> np.ndarray:
        """Return dσ/dt."""
        relaxing = stress + self.mobility / self.modulus * stress @ stress
        production = self.modulus * rate_tensor(rate) + stretched(stress, rate)
        return production - relaxing / self.relaxation_time

    def steady_shear(self, rate: float) -> tuple[float, float, float]:
        """Return steady σ12, N1 and N2   [Bird, Armstrong & Hassager 1987, table 7.3-2]."""
        a, weissenberg = self.mobility, self.relaxation_time * rate
        root = np.sqrt(1 + 16 * a * (1 - a) * weissenberg**2)
        chi2 = (root - 1) / (8 * a * (1 - a) * weissenberg**2)
        f = (1 - np.sqrt(chi2)) / (1 + (1 - 2 * a) * np.sqrt(chi2))
        viscosity = (1 - f) ** 2 / (1 + (1 - 2 * a) * f)
        first = f * (1 - a * f) / (a * (1 - f) * weissenberg**2)
        return (
            self.modulus * weissenberg * viscosity,
            2 * self.modulus * weissenberg**2 * first,
            -self.modulus * f,
        )


class GiesekusModes(Modes):
    """Modes that each have a mobility of their own, stepped as one array."""

    def __init__(self, *laws: Giesekus):
        super().__init__(*laws)
        columns = [(law.mobility, law.modulus, law.relaxation_time) for law in laws]
        self._mobility, self._moduli, self._times = np.array(columns, float).T[..., None, None]

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return dσ/dt of all modes, as each law by itself says it."""
        stress = state.reshape(-1, 3, 3)
        relaxing = stress + self._mobility / self._moduli * (stress @ stress)
        production = self._moduli * rate_tensor(rate) + stretched(stress, rate)
        return (production - relaxing / self._times).ravel()


def multimode_giesekus(
    mobilities: Sequence[float], moduli: Sequence[float], relaxation_times: Sequence[float]
) -> Modes:
    """Return modes that each have a mobility of their own."""
    parts = zip(mobilities, moduli, relaxation_times, strict=True)
    return GiesekusModes(*(Giesekus(*part) for part in parts))
