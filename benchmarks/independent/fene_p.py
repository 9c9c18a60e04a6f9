"""FENE-P law, by its conformation."""

from dataclasses import dataclass

import numpy as np

from independent.material import RateLaw, stretched


@dataclass(frozen=True)
class FenePeterlin(RateLaw):
    """A▽ = −(f A − I)/λ, σ = G (f A − I), f = (L² − 3)/(L² − tr A).

    [Bird, Dotson & Johnson 1980, JNNFM 7, 213]; A = I at rest.
    """

    maximum_extension_squared: float = 50.0  # L²
    modulus: float = 1.0
    relaxation_time: float = 1.0

    def _tension(self, conformation: np.ndarray) -> np.ndarray:
        limit = self.maximum_extension_squared
        factor = (limit - 3) / (limit - np.trace(conformation))
        return factor * conformation - np.eye(3)

    def rest(self) -> np.ndarray:
        """Return A = I."""
        return np.eye(3).ravel()

    def change(self, state: np.ndarray, rate: float) -> np.ndarray:
        """Return dA/dt."""
        conformation = state.reshape(3, 3)
        relaxing = self._tension(conformation) / self.relaxation_time
        return (stretched(conformation, rate) - relaxing).ravel()

    def stress(self, state: np.ndarray, rate: float) -> np.ndarray:
        """Return G (f A − I)."""
        del rate
        return self.modulus * self._tension(state.reshape(3, 3))
