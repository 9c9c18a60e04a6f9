"""Rolie–Poly law of entangled linear chains, with and without stretch."""

from dataclasses import dataclass

import numpy as np

from independent.material import Rate, RateLaw, stretched, velocity_gradient


@dataclass(frozen=True)
class RoliePoly(RateLaw):
    """A▽ = −(A − I)/τ_d − (2/τ_R)(1 − √(3/tr A))(A + β (tr A/3)^δ (A − I)), σ = G (A − I).

    Without stretch (τ_R = 0): A▽ = −(A − I)/τ_d − (2/3)(L:A)(A + β (A − I)), which keeps tr A = 3.
    [Likhtman & Graham 2003, JNNFM 114, 1, eqs. 11 and 12]
    """

    release: float = 1.0  # β
    stretch_time: float = 0.1  # τ_R, s; 0: no stretch
    exponent: float = -0.5  # δ
    modulus: float = 1.0
    relaxation_time: float = 1.0  # τ_d, s

    def rest(self) -> np.ndarray:
        """Return A = I."""
        return np.eye(3).ravel()

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return dA/dt."""
        a, one = state.reshape(3, 3), np.eye(3)
        change = stretched(a, rate) - (a - one) / self.relaxation_time
        if self.stretch_time == 0.0:
            retraction = 2 / 3 * np.sum(velocity_gradient(rate) * a)
            return (change - retraction * (a + self.release * (a - one))).ravel()
        trace = max(np.trace(a), 1e-12)  # below 3 only in trial steps
        retraction = 2 / self.stretch_time * (1 - np.sqrt(3 / trace))
        released = self.release * (trace / 3) ** self.exponent
        return (change - retraction * (a + released * (a - one))).ravel()

    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return G (A − I)."""
        del rate
        return self.modulus * (state.reshape(3, 3) - np.eye(3))
