"""Laws with a structure that flow breaks and rest mends, in Pa and s; a source stands with each."""

from dataclasses import dataclass

import numpy as np

from independent.material import Rate, RateLaw, rate_tensor, stretched


@dataclass(frozen=True)
class Structured(RateLaw):
    """t_i ds_i/dt = 1 − s_i − (X/X_c)ⁿ s_i, s = (1 − w) s₁ + w s₂, one at rest, on full tensors.

    Cross 1965, J. Colloid Sci. 20, 417, for one structure; Wei, Solomon & Larson 2018, J. Rheol.
    62, 321, for several. X is √(2 D:D), or the stress that does the same work at that rate.
    """

    critical: float  # X_c, 1/s or Pa
    times: tuple[float, ...] = (2.0,)  # t_i, s
    exponent: float = 1.0  # n
    slow_share: float = 0.0  # w
    by_stress: bool = False
    in_modulus: bool = False
    modulus: float = 100.0  # Pa
    relaxation_time: float = 1.0  # s
    mobility: float = 0.2

    def rest(self) -> np.ndarray:
        return np.append(np.ones(len(self.times)), np.zeros(9))

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        levels, a = np.split(state, [len(self.times)])
        a = a.reshape(3, 3)
        gradient = (
            np.array([[0.0, rate, 0.0], [0.0] * 3, [0.0] * 3]) if np.ndim(rate) == 0 else rate
        )
        both = gradient + gradient.T
        intensity = np.sqrt(0.5 * np.sum(both * both))
        x = intensity
        if self.by_stress:
            work = 0.5 * np.sum(both * self.stress(state, rate))
            x = abs(work) / intensity if intensity else 0.0
        levels_change = (1.0 - levels * (1.0 + (x / self.critical) ** self.exponent)) / self.times
        time = self.relaxation_time * (1.0 if self.in_modulus else self._whole(levels))
        relaxes = (a + self.mobility * a @ a) / time
        return np.append(levels_change, both + gradient @ a + a @ gradient.T - relaxes)

    def _whole(self, levels: np.ndarray) -> float:
        w = self.slow_share
        return levels[0] if len(levels) == 1 else (1.0 - w) * levels[0] + w * levels[1]

    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        levels, a = np.split(state, [len(self.times)])
        share = self._whole(levels) if self.in_modulus else 1.0
        return share * self.modulus * a.reshape(3, 3)


@dataclass(frozen=True)
class Thixotropic(RateLaw):
    """σ = s σ_law, ds/dt = (1 − s)/t_b − k |γ̇|^m s^p, s = 1 at rest.

    m = p = 1 is Moore 1959, Trans. Br. Ceram. Soc. 58, 470; others as in Mewis & Wagner 2009, Adv.
    Colloid Interface Sci. 147–148, 214, table 1.
    """

    law: RateLaw
    breakdown: float = 0.1  # k, s^(m−1)
    build_up_time: float = 10.0  # t_b, s
    rate_power: float = 1.0  # m
    structure_power: float = 1.0  # p

    @property
    def modulus(self) -> float:
        """Modulus of the law, in Pa."""
        return self.law.modulus

    def rest(self) -> np.ndarray:
        return np.append(1.0, self.law.rest())

    def scale(self) -> np.ndarray:
        return np.append(1.0, self.law.scale())

    def change(self, state: np.ndarray, rate: float) -> np.ndarray:
        s = max(state[0], 0.0)
        broken = self.breakdown * abs(rate) ** self.rate_power * s**self.structure_power
        return np.append((1 - s) / self.build_up_time - broken, self.law.change(state[1:], rate))

    def stress(self, state: np.ndarray, rate: float) -> np.ndarray:
        return state[0] * self.law.stress(state[1:], rate)


@dataclass(frozen=True)
class SoftGlass(RateLaw):
    """σ▽ = G γ̇ − D σ, dD/dt = −r D² + u |γ̇|², D = 1/λ at first.

    A Landau expansion of the rate of relaxation after Derec, Ajdari & Lequeux 2001, Eur. Phys. J. E
    4, 355; the powers and the tensor form are a choice made here. At rest D = 1/(λ + r t), so that
    the relaxation time grows with the age. In steady flow D = √(u/r) |γ̇|: the stress ends at the
    yield stress G √(r/u).
    """

    ageing: float = 0.2  # r
    rejuvenation: float = 0.2  # u
    modulus: float = 1.0
    relaxation_time: float = 1.0

    def rest(self) -> np.ndarray:
        return np.append(1.0 / self.relaxation_time, np.zeros(9))

    def scale(self) -> np.ndarray:
        return np.append(1.0 / self.relaxation_time, np.full(9, self.modulus))

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        relaxing, stress = state[0], state[1:].reshape(3, 3)
        intensity = np.sum(rate_tensor(rate) ** 2) / 2
        young = -self.ageing * relaxing**2 + self.rejuvenation * intensity
        driven = self.modulus * rate_tensor(rate) + stretched(stress, rate)
        return np.append(young, driven - relaxing * stress)

    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        return state[1:].reshape(3, 3)
