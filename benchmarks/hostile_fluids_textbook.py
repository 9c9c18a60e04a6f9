"""Fluids and instruments of textbooks that stand in no other file of these benchmarks."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from independent.flow import Flow
from independent import KBKZ
from independent.material import (
    Material,
    Rate,
    RateLaw,
    Stresses,
    StressLaw,
    integrate,
    rate_tensor,
    stretched,
)

ONE = np.eye(3)


def leonov(a: np.ndarray, gradient: np.ndarray) -> np.ndarray:
    """Return −(A·A − I)/2, in shear   [Leonov 1976, Rheol. Acta 15, 85].

    The traces of A and of its inverse are equal in plane flow, so that this is Giesekus with ½.
    """
    del gradient
    return -(a @ a - ONE) / 2


@dataclass(frozen=True)
class PartlyRetracting(StressLaw):
    """σ▽ + (2ξ/3G)(D:σ)(σ + G I) + σ/λ = 2 G D   [Larson 1984, J. Rheol. 28, 545]; ξ = 1: rods."""

    retraction: float = 0.5  # ξ
    modulus: float = 100.0
    relaxation_time: float = 1.0

    def stress_change(self, stress: np.ndarray, rate: Rate) -> np.ndarray:
        """Return dσ/dt."""
        twice = rate_tensor(rate)
        work = np.sum(twice * stress) / 2
        lost = 2 * self.retraction / (3 * self.modulus) * work * (stress + self.modulus * ONE)
        return stretched(stress, rate) + self.modulus * twice - lost - stress / self.relaxation_time


@dataclass(frozen=True)
class FeneCR(RateLaw):
    """c▽ = −f (c − I)/λ, σ = G f (c − I), f = 1/(1 − tr c/b)   [Chilcott & Rallison 1988]."""

    extensibility: float = 20.0  # b
    modulus: float = 100.0
    relaxation_time: float = 1.0

    def _spring(self, c: np.ndarray) -> float:
        return (1 - 3 / self.extensibility) / (1 - np.trace(c) / self.extensibility)

    def rest(self) -> np.ndarray:
        """Return c = I."""
        return ONE.ravel()

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return dc/dt."""
        c = state.reshape(3, 3)
        back = self._spring(c) * (c - ONE) / self.relaxation_time
        return (stretched(c, rate) - back).ravel()

    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return G f (c − I)."""
        del rate
        c = state.reshape(3, 3)
        return self.modulus * self._spring(c) * (c - ONE)


@dataclass(frozen=True)
class Acierno(RateLaw):
    """σ▽ = 2 G x D − σ/(λ x^1.4) + (ẋ/x) σ, ẋ = (1 − x)/(λ x^1.4) − (a/λ x^1.4) x √(tr σ/(2 G x)).

    [Acierno, La Mantia, Marrucci & Titomanlio 1976, J. Non-Newtonian Fluid Mech. 1, 125]; modulus
    and relaxation time follow one structure that the stress breaks.
    """

    breakdown: float = 0.4  # a
    modulus: float = 100.0
    relaxation_time: float = 1.0

    def rest(self) -> np.ndarray:
        """Return no stress and the whole structure."""
        return np.append(np.zeros(9), 1.0)

    def scale(self) -> np.ndarray:
        """Return the modulus, nine times, and 1."""
        return np.append(np.full(9, self.modulus), 1.0)

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return dσ/dt and dx/dt."""
        stress, x = state[:9].reshape(3, 3), state[9]
        time = self.relaxation_time * x**1.4
        load = np.sqrt(max(np.trace(stress), 0.0) / (2 * self.modulus * x))
        dx = (1 - x) / time - self.breakdown * x * load / time
        own = self.modulus * x * rate_tensor(rate) - stress / time + dx / x * stress
        return np.append((stretched(stress, rate) + own).ravel(), dx)

    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return σ."""
        del rate
        return state[:9].reshape(3, 3)


def drops(a: np.ndarray, gradient: np.ndarray, affinity: float) -> np.ndarray:
    """Return −(1 − f)(D·A + A·D) − (A − g I), g = 3 det A/II keeping the volume of an ellipsoid.

    [Maffettone & Minale 1998, J. Non-Newtonian Fluid Mech. 78, 227].
    """
    strain = (gradient + gradient.T) / 2
    second = (np.trace(a) ** 2 - np.trace(a @ a)) / 2
    slipping = (1 - affinity) * (strain @ a + a @ strain)
    return -slipping - (a - 3 * np.linalg.det(a) / second * ONE)


@dataclass(frozen=True)
class Damped(KBKZ):
    """σ12 = ∫ m h(γ) γ dt' with a damping function h of its own, otherwise as `KBKZ`."""

    function: Callable[[np.ndarray], np.ndarray] = np.ones_like

    def damped(self, strain: np.ndarray) -> np.ndarray:
        """Return h(γ)."""
        return self.function(strain)


def of_doi_edwards(strain: np.ndarray) -> np.ndarray:
    """Return h(γ) of tubes, by the approximation of Currie 1982, JNNFM 11, 53."""
    first = 3 + strain**2
    root = np.sqrt(first + 13 / 4)
    return 5 / (first + 2 * root - 1) * (1 + 1 / root)


def of_papanastasiou(strain: np.ndarray) -> np.ndarray:
    """Return 1/(1 + γ²/6)   [Papanastasiou, Scriven & Macosko 1983, J. Rheol. 27, 387]."""
    return 1 / (1 + strain**2 / 6)


@dataclass(frozen=True)
class Banding(RateLaw):
    """Johnson–Segalman across a gap: σ diffuses, Σ = σ12 + η_s γ̇ is one, the mean γ̇ imposed.

    [Olmsted, Radulescu & Lu 2000, J. Rheol. 44, 257]. The gap is of a wide cylinder, so that the
    stress falls across it by `curvature`.
    """

    slip: float = 0.3  # ξ of the convected derivative
    viscosity: float = 2.0  # η_s, Pa s
    diffusion: float = 4e-3  # of the gap squared a second
    curvature: float = 0.05
    layers: int = 24
    modulus: float = 100.0
    relaxation_time: float = 1.0

    def rest(self) -> np.ndarray:
        """Return no stress: σ11, σ22 and σ12 of each layer."""
        return np.zeros(3 * self.layers)

    def scale(self) -> np.ndarray:
        """Return the modulus."""
        return np.full(3 * self.layers, self.modulus)

    def _rates(self, shear: np.ndarray, rate: float) -> tuple[np.ndarray, float]:
        shape = 1 - self.curvature * (np.arange(self.layers) + 0.5) / self.layers
        total = (rate * self.viscosity + np.mean(shear)) / np.mean(shape)
        return (total * shape - shear) / self.viscosity, total

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return the rates of change."""
        first, second, shear = state.reshape(3, -1)
        local, _ = self._rates(shear, float(rate))
        a = 1 - self.slip
        own = np.array([
            local * (1 + a) * shear,
            -local * (1 - a) * shear,
            local * (self.modulus + (1 + a) / 2 * second - (1 - a) / 2 * first),
        ])  # fmt: skip
        padded = np.pad(state.reshape(3, -1), ((0, 0), (1, 1)), mode="edge")
        spread = self.diffusion * self.layers**2 * np.diff(padded, 2, axis=1)
        return (own - state.reshape(3, -1) / self.relaxation_time + spread).ravel()

    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return what the inner wall feels, and the mean of the rest."""
        first, second, shear = state.reshape(3, -1)
        _, total = self._rates(shear, float(rate))
        means = np.diag([np.mean(first), np.mean(second), 0.0])
        means[0, 1] = means[1, 0] = total
        return means


@dataclass(frozen=True)
class Waves(Material):
    """A Maxwell fluid between plates with inertia of its own: ρ h² v̇ = ∂σ/∂y, σ̇ = G ∂v/∂y − σ/λ.

    [Schrag 1977, Trans. Soc. Rheol. 21, 399]; one plate moves, the other feels the stress.
    """

    inertia: float = 0.3  # ρ h², Pa s²
    layers: int = 40
    modulus: float = 100.0
    relaxation_time: float = 1.0

    def respond(self, flow: Flow, times: np.ndarray) -> Stresses:
        """Return the stress at the plate that stands; nobody knows the others."""
        times, n = np.asarray(times, float), self.layers

        def change(t, state):
            speed, stress = state[: n - 1], state[n - 1 :]
            whole = np.concatenate([[0.0], speed, [float(flow.rate(t))]])
            return np.append(
                np.diff(stress) * n / self.inertia,
                self.modulus * np.diff(whole) * n - stress / self.relaxation_time,
            )

        start = np.zeros(2 * n - 1)
        scale = np.append(np.ones(n - 1), np.full(n, self.modulus))
        shear = integrate(change, start, times, flow.jumps, scale)[:, n - 1]
        return Stresses(shear, np.full_like(shear, np.nan), np.full_like(shear, np.nan))
