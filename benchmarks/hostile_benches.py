"""Benches of hostile records: geometry, slip, age, gaps; a source stands with each."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from hostile_fluids import without_normal
from independent import Flow, Material, RateLaw, Stresses
from independent.material import Rate, integrate


@dataclass(frozen=True)
class PlatePlate(Material):
    """Parallel plates, their torque told as that of a Newtonian fluid: 4 ∫ x² σ(x γ̇_R) dx.

    No Weissenberg–Rabinowitsch correction   [Bird, Armstrong & Hassager 1987, eq. 10.2-15]. Normal
    stresses are those at the rim, where the rate is the one that is told.
    """

    law: RateLaw
    points: int = 8

    def respond(self, flow: Flow, times: np.ndarray) -> Stresses:
        nodes, weights = np.polynomial.legendre.leggauss(self.points)
        apparent = 0.0
        for x, weight in zip((nodes + 1) / 2, weights / 2, strict=True):
            inner = Flow(
                lambda t, x=x: x * flow.rate(t), lambda t, x=x: x * flow.strain(t), flow.jumps
            )
            apparent = apparent + 4 * weight * x**2 * self.law.respond(inner, times).sigma12
        return replace(self.law.respond(flow, times), sigma12=apparent)


@dataclass(frozen=True)
class _OneMore(RateLaw):
    """A law whose state has one number more, before those of another law: zero at rest."""

    law: RateLaw
    modulus = 100.0

    def rest(self) -> np.ndarray:
        return np.append(0.0, self.law.rest())

    def scale(self) -> np.ndarray:
        return np.append(1.0, self.law.scale())


@dataclass(frozen=True)
class Networked(_OneMore):
    """A law beside a permanent neo-Hookean network: σ12 = E γ and N1 = E γ² more."""

    network: float = 15.0

    def change(self, state: np.ndarray, rate: float) -> np.ndarray:
        return np.append(rate, self.law.change(state[1:], rate))

    def stress(self, state: np.ndarray, rate: float) -> np.ndarray:
        strain = state[0]
        elastic = np.array([[strain**2, strain, 0.0], [strain, 0.0, 0.0], [0.0, 0.0, 0.0]])
        return self.law.stress(state[1:], rate) + self.network * elastic


@dataclass(frozen=True)
class Aged(_OneMore):
    """A law whose constants change with its age: by a factor of it in s for each, of `grows`."""

    grows: Mapping[str, Callable[[float], float]]
    begin: float = 0.0  # s

    def rest(self) -> np.ndarray:
        return np.append(self.begin, self.law.rest())

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        factors = {name: factor(state[0]) for name, factor in self.grows.items()}
        now = {name: getattr(self.law, name) * factor for name, factor in factors.items()}
        return np.append(1.0, replace(self.law, **now).change(state[1:], rate))

    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        return self.law.stress(state[1:], rate)


@dataclass(frozen=True)
class CriticalSlip(_OneMore):
    """Wall slip that sets in beyond a stress, with a memory: γ̇_felt = γ̇ − s m σ, m' = (H − m)/τ.

    H goes from 0 to 1 within some 10 Pa of the critical stress.
    """

    slip: float = 0.006  # 1/(Pa s)
    critical: float = 60.0
    memory: float = 1.0

    def _felt(self, state: np.ndarray, rate: float) -> float:
        return rate - self.slip * state[0] * self.law.stress(state[1:], rate)[0, 1]

    def change(self, state: np.ndarray, rate: float) -> np.ndarray:
        stress = abs(self.law.stress(state[1:], rate)[0, 1])
        target = 1 / (1 + np.exp(-(stress - self.critical) / 3.0))
        change = self.law.change(state[1:], self._felt(state, rate))
        return np.append((target - state[0]) / self.memory, change)

    def stress(self, state: np.ndarray, rate: float) -> np.ndarray:
        return self.law.stress(state[1:], self._felt(state, rate))


@dataclass(frozen=True)
class Couette(Material):
    """Coaxial cylinders of a ratio of radii; stress and rate told as ISO 3219 has them.

    The rate that is told is Ω (δ² + 1)/(δ² − 1), the stress the mean of those at both walls: right
    for a Newtonian fluid. Here σ12 r² is the same everywhere and Ω = ∫ γ̇ dr/r, no inertia. Normal
    stresses are those at the rate that is told.
    """

    law: RateLaw
    ratio: float = 1.0847  # δ of the standard
    layers: int = 6

    def respond(self, flow: Flow, times: np.ndarray) -> Stresses:
        nodes, weights = np.polynomial.legendre.leggauss(self.layers)
        radii = 1 + (self.ratio - 1) * (nodes + 1) / 2
        weights = weights * (self.ratio - 1) / 2
        size, law = len(self.law.rest()), self.law

        def change(t, states):
            layers = states.reshape(self.layers, size)
            still = np.array([law.change(s, 0.0) for s in layers])
            sheared = np.array([law.change(s, 1.0) for s in layers]) - still
            own, driven = still[:, 1], sheared[:, 1]  # of the nine components the second is σ12
            turn = flow.rate(t) * (self.ratio**2 - 1) / (self.ratio**2 + 1)
            torque = turn + np.sum(weights * own / driven / radii)
            torque = torque / np.sum(weights / driven / radii**3)
            rates = (torque / radii**2 - own) / driven
            return (still + rates[:, None] * sheared).ravel()

        start, scale = (np.tile(one, self.layers) for one in (law.rest(), law.scale()))
        states = integrate(change, start, times, flow.jumps, scale)
        shear = states.reshape(len(times), self.layers, size)[:, :, 1]
        told = np.mean(shear * radii**2, axis=1) * (1 + 1 / self.ratio**2) / 2
        return replace(law.respond(flow, times), sigma12=told)


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
        return np.zeros(3 * self.layers)

    def scale(self) -> np.ndarray:
        return np.full(3 * self.layers, self.modulus)

    def _rates(self, shear: np.ndarray, rate: float) -> tuple[np.ndarray, float]:
        shape = 1 - self.curvature * (np.arange(self.layers) + 0.5) / self.layers
        total = (rate * self.viscosity + np.mean(shear)) / np.mean(shape)
        return (total * shape - shear) / self.viscosity, total

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        layers, a = state.reshape(3, -1), 1 - self.slip
        first, second, shear = layers
        local, _ = self._rates(shear, float(rate))
        lifted = self.modulus + (1 + a) / 2 * second - (1 - a) / 2 * first
        own = np.array([local * (1 + a) * shear, -local * (1 - a) * shear, local * lifted])
        padded = np.pad(layers, ((0, 0), (1, 1)), mode="edge")
        spread = self.diffusion * self.layers**2 * np.diff(padded, 2, axis=1)
        return (own - layers / self.relaxation_time + spread).ravel()

    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        first, second, shear = state.reshape(3, -1)
        means = np.diag([np.mean(first), np.mean(second), 0.0])
        _, means[0, 1] = self._rates(shear, float(rate))
        means[1, 0] = means[0, 1]
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
        times, n = np.asarray(times, float), self.layers

        def change(t, state):
            speed, stress = state[: n - 1], state[n - 1 :]
            whole = np.concatenate([[0.0], speed, [float(flow.rate(t))]])
            sheared = self.modulus * np.diff(whole) * n - stress / self.relaxation_time
            return np.append(np.diff(stress) * n / self.inertia, sheared)

        scale = np.append(np.ones(n - 1), np.full(n, self.modulus))
        states = integrate(change, np.zeros(2 * n - 1), times, flow.jumps, scale)
        return without_normal(states[:, n - 1])
