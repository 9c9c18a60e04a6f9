"""Pom-pom law of branched melts, differential, and its extension with a second normal stress."""

from dataclasses import dataclass

import numpy as np

from independent.material import Rate, RateLaw, StressLaw, rate_tensor, stretched, velocity_gradient


@dataclass(frozen=True)
class PomPom(RateLaw):
    """A▽ = −(A − I/3)/τ_b, S = A/tr A, Λ' = Λ (L:S) − (Λ − 1) e^{2(Λ−1)/(q−1)}/τ_s.

    σ = 3 G Λ² S − G I   [McLeish & Larson 1998, J. Rheol. 42, 81, differential approximation; the
    exponential of Blackwell, McLeish & Harlen 2000, J. Rheol. 44, 121, which the first have not].
    Λ grows no further than q; growth fades on the way there, so that an integrator can follow.
    """

    arms: float = 5.0  # q
    stretch_time: float = 0.4  # τ_s, s
    modulus: float = 1.0
    relaxation_time: float = 1.0  # τ_b, s
    drag_strain: bool = True  # whether there is the exponential
    fade: float = 0.02  # share of q over which growth fades

    def rest(self) -> np.ndarray:
        """Return A = I/3 and Λ = 1."""
        return np.append(np.eye(3).ravel() / 3, 1.0)

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return dA/dt and dΛ/dt."""
        a, stretch = state[:9].reshape(3, 3), state[9]
        turned = stretched(a, rate) - (a - np.eye(3) / 3) / self.relaxation_time
        drawn = stretch * np.sum(velocity_gradient(rate) * a) / np.trace(a)
        # far outside (0, q) only in trial steps of the integrator
        fast = np.exp(min(2 / (self.arms - 1) * (stretch - 1), 50.0)) if self.drag_strain else 1.0
        grown = drawn - (stretch - 1) * fast / self.stretch_time
        if grown > 0.0:
            grown *= min(max((self.arms - stretch) / (self.fade * self.arms), 0.0), 1.0)
        return np.append(turned.ravel(), grown)

    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return 3 G Λ² S − G I."""
        del rate
        a = state[:9].reshape(3, 3)
        return self.modulus * (3 * state[9] ** 2 * a / np.trace(a) - np.eye(3))


@dataclass(frozen=True)
class ExtendedPomPom(StressLaw):
    """σ▽ + [(α/G) σ·σ + f σ + G (f − 1) I]/λ_b = G γ̇.

    f = 2 (λ_b/λ_s) e^{2(Λ−1)/q} (1 − 1/Λ) + (1 − α tr(σ·σ)/(3 G²))/Λ², Λ² = 1 + tr σ/(3G)
    [Verbeeten, Peters & Baaijens 2001, J. Rheol. 45, 823, single-equation form].
    """

    arms: float = 5.0  # q
    anisotropy: float = 0.1  # α
    stretch_time: float = 0.4  # λ_s, s
    modulus: float = 1.0
    relaxation_time: float = 1.0  # λ_b, s

    def stress_change(self, stress: np.ndarray, rate: Rate) -> np.ndarray:
        """Return dσ/dt."""
        g, a = self.modulus, self.anisotropy
        square = stress @ stress
        stretch = np.sqrt(max(1 + np.trace(stress) / (3 * g), 1e-12))
        fast = np.exp(min(2 / self.arms * (stretch - 1), 50.0))
        f = 2 * self.relaxation_time / self.stretch_time * fast * (1 - 1 / stretch)
        f += (1 - a * np.trace(square) / (3 * g**2)) / stretch**2
        relaxing = a / g * square + f * stress + g * (f - 1) * np.eye(3)
        return g * rate_tensor(rate) + stretched(stress, rate) - relaxing / self.relaxation_time
