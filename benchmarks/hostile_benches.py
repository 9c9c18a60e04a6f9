"""Fluids on benches that are not what is told of them: cells, slip, age; a source with each."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
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
        rim = self.law.respond(flow, times)
        return Stresses(apparent, rim.N1, rim.N2)


@dataclass(frozen=True)
class _OneMore(RateLaw):
    """A law whose state has one number more, before those of another law: zero at rest."""

    law: RateLaw

    def rest(self) -> np.ndarray:
        return np.append(0.0, self.law.rest())

    def scale(self) -> np.ndarray:
        return np.append(1.0, self.law.scale())


@dataclass(frozen=True)
class Networked(_OneMore):
    """A law beside a permanent neo-Hookean network: σ12 = E γ and N1 = E γ² more."""

    network: float = 15.0
    modulus: float = 100.0

    def change(self, state: np.ndarray, rate: float) -> np.ndarray:
        return np.append(rate, self.law.change(state[1:], rate))

    def stress(self, state: np.ndarray, rate: float) -> np.ndarray:
        strain = state[0]
        elastic = np.array([[strain**2, strain, 0.0], [strain, 0.0, 0.0], [0.0, 0.0, 0.0]])
        return self.law.stress(state[1:], rate) + self.network * elastic


@dataclass(frozen=True)
class Aged(_OneMore):
    """A law that changes with its age since the start of a run: it dries, warms or grows."""

    at: Callable[[RateLaw, float], RateLaw]
    begin: float = 0.0  # s
    modulus: float = 100.0

    def rest(self) -> np.ndarray:
        return np.append(self.begin, self.law.rest())

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        return np.append(1.0, self.at(self.law, state[0]).change(state[1:], rate))

    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        return self.law.stress(state[1:], rate)


def ageing(law: RateLaw, growth: float = 0.03) -> Aged:
    def at(law, age):
        return replace(law, relaxation_time=law.relaxation_time * (1 + growth * age))

    return Aged(law, at)


def warming(law: RateLaw, share: float = 0.1, time: float = 3.0) -> Aged:
    """Return a law whose time is longer by a share at first, which dies out."""

    def at(law, age):
        now = law.relaxation_time * (1 + share * np.exp(-age / time))
        return replace(law, relaxation_time=now)

    return Aged(law, at)


def evaporating(law: RateLaw, begin: float, of_modulus: float, of_time: float) -> Aged:
    """Return a law whose modulus and time grow with its age, as its solvent goes."""

    def at(law, age):
        modulus = law.modulus * (1 + of_modulus * age)
        time = law.relaxation_time * (1 + of_time * age)
        return replace(law, modulus=modulus, relaxation_time=time)

    return Aged(law, at, begin)


@dataclass(frozen=True)
class CriticalSlip(_OneMore):
    """Wall slip that sets in beyond a stress, with a memory: γ̇_felt = γ̇ − s m σ, m' = (H − m)/τ.

    H goes from 0 to 1 within some 10 Pa of the critical stress.
    """

    slip: float = 0.006  # 1/(Pa s)
    critical: float = 60.0
    memory: float = 1.0
    modulus: float = 100.0

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
            # of the nine components of a stress the second is σ12
            own, driven = still[:, 1], sheared[:, 1]
            turn = flow.rate(t) * (self.ratio**2 - 1) / (self.ratio**2 + 1)
            torque = (turn + np.sum(weights * own / driven / radii)) / np.sum(
                weights / driven / radii**3
            )
            rates = (torque / radii**2 - own) / driven
            return (still + rates[:, None] * sheared).ravel()

        scale = np.tile(law.scale(), self.layers)
        states = integrate(
            change, np.tile(law.rest(), self.layers), times, flow.jumps, scale
        ).reshape(len(times), self.layers, size)
        torque = np.mean(states[:, :, 1] * radii**2, axis=1)
        told = torque * (1 + 1 / self.ratio**2) / 2
        inside = law.respond(flow, times)
        return Stresses(told, inside.N1, inside.N2)


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
