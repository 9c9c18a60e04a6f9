"""Rolie–Double–Poly law of a bidisperse melt."""

from dataclasses import dataclass

import numpy as np

from independent.material import Rate, RateLaw, stretched


@dataclass(frozen=True)
class RoliePolyBlend(RateLaw):
    """Four conformations A_ij of chains i along entanglements with chains j, 1 long and 2 short.

    A_ij▽ = −(A_ij − I)/(2 τ_d,i) − (2/τ_s,i)((Λ_i − 1)/Λ_i) A_ij
            − [1/(2 τ_d,j) + β (2/τ_s,j)((Λ_j − 1)/Λ_j) Λ_i^{−1}] (A_ij − I),
    Λ_i² = tr A_i/3, A_i = Σ φ_j A_ij, σ = G (Σ φ_i A_i − I)
    [Boudara, Peterson, Leal & Read 2019, J. Rheol. 63, 71, with β_th = 1].
    """

    share: tuple[float, float] = (0.3, 0.7)
    relaxation_time: tuple[float, float] = (1.0, 0.1)  # τ_d, s
    stretch_time: tuple[float, float] = (0.1, 0.02)  # τ_s, s
    release: float = 1.0  # β
    modulus: float = 1.0

    def rest(self) -> np.ndarray:
        """Return A_ij = I."""
        return np.tile(np.eye(3), (2, 2, 1, 1)).ravel()

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return dA_ij/dt."""
        a, one = state.reshape(2, 2, 3, 3), np.eye(3)
        stretch, out = [], np.zeros((2, 2, 3, 3))
        for i in range(2):
            of_chain = self.share[0] * a[i, 0] + self.share[1] * a[i, 1]
            stretch.append(np.sqrt(max(np.trace(of_chain) / 3.0, 1e-12)))
        drawn = [2.0 / t * (x - 1.0) / x for t, x in zip(self.stretch_time, stretch, strict=True)]
        for i in range(2):
            for j in range(2):
                lost = 0.5 / self.relaxation_time[i] + 0.5 / self.relaxation_time[j]
                lost += self.release * drawn[j] / stretch[i]
                out[i, j] = stretched(a[i, j], rate) - lost * (a[i, j] - one) - drawn[i] * a[i, j]
        return out.ravel()

    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return G (Σ φ_i φ_j A_ij − I)."""
        del rate
        weights = np.outer(self.share, self.share)
        mean = np.tensordot(weights, state.reshape(2, 2, 3, 3), axes=2)
        return self.modulus * (mean - np.eye(3))
