"""Laws of melts, solutions and gels as their authors write them, on full tensors.

Each function returns what the upper-convected derivative of the conformation A = I + σ is, with
time over the relaxation time.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from independent.material import Rate, RateLaw, stretched, velocity_gradient

ONE = np.eye(3)


def cohen(squared, limit):
    """Return Cohen's approximation of the inverse Langevin function, over that at rest."""

    def spring(ratio):
        return (3 - ratio) / (1 - ratio)

    return spring(squared / limit) / spring(1 / limit)


def rolie_poly_fene(a, gradient, stretch_time_ratio, beta, maximum_stretch):
    stretch = np.sqrt(np.trace(a) / 3)
    k = cohen(stretch**2, maximum_stretch**2)
    retraction = 2 / stretch_time_ratio * k * (1 - 1 / stretch)
    return -(a - ONE) - retraction * (a + beta / stretch * (a - ONE))


def white_metzner(a, gradient, k, n):
    rate = gradient + gradient.T
    size = np.sqrt(0.5 * np.trace(rate @ rate))
    return -(a - ONE) * (1 + (k * size) ** 2) ** ((1 - n) / 2)


def saramito(a, gradient, yield_strain):
    s = a - ONE
    deviator = s - np.trace(s) / 3 * ONE
    size = np.sqrt(0.5 * np.trace(deviator @ deviator))
    return -max(0.0, 1 - yield_strain / size if size > 0 else 0.0) * s


def giesekus_non_affine(a, gradient, alpha, xi):
    s, rate = a - ONE, gradient + gradient.T
    return -s - alpha * s @ s - xi / 2 * (s @ rate + rate @ s)


@dataclass(frozen=True)
class ByAuthors(RateLaw):
    """A▽ = f(A, λL)/λ, σ = G (A − I), times Cohen's spring where chains end.

    `law`: one of the functions of `authors`.
    `constants`: of the law, by name.
    `modulus`, `relaxation_time` in Pa and s.
    """

    law: Callable[..., np.ndarray]
    constants: Mapping[str, float] = field(default_factory=dict)
    modulus: float = 1.0
    relaxation_time: float = 1.0

    def rest(self) -> np.ndarray:
        return np.eye(3).ravel()

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        a, time = state.reshape(3, 3), self.relaxation_time
        own = self.law(a, velocity_gradient(rate) * time, **self.constants) / time
        return (stretched(a, rate) + own).ravel()

    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        a = state.reshape(3, 3)
        spring = 1.0
        if self.law is rolie_poly_fene:
            spring = cohen(np.trace(a) / 3, self.constants["maximum_stretch"] ** 2)
        return self.modulus * spring * (a - ONE)
