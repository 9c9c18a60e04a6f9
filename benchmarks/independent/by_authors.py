"""A law of `authors` as a material, in Pa and s and in any homogeneous flow."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from independent.authors import ONE, cohen, rolie_poly_fene
from independent.material import Rate, RateLaw, stretched, velocity_gradient


@dataclass(frozen=True)
class ByAuthors(RateLaw):
    """A▽ = f(A, λL)/λ, σ = G (A − I), times Cohen's spring where chains end.

    Attributes
    ----------
    law
        One of the functions of `authors`.
    constants
        Of the law, by name.
    modulus, relaxation_time
        In Pa and s.
    """

    law: Callable[..., np.ndarray]
    constants: Mapping[str, float] = field(default_factory=dict)
    modulus: float = 1.0
    relaxation_time: float = 1.0

    def rest(self) -> np.ndarray:
        """Return A = I."""
        return np.eye(3).ravel()

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return dA/dt."""
        a, time = state.reshape(3, 3), self.relaxation_time
        own = self.law(a, velocity_gradient(rate) * time, **self.constants) / time
        return (stretched(a, rate) + own).ravel()

    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return G (A − I), times the spring."""
        del rate
        a = state.reshape(3, 3)
        spring = 1.0
        if self.law is rolie_poly_fene:
            spring = cohen(np.trace(a) / 3, self.constants["maximum_stretch"] ** 2)
        return self.modulus * spring * (a - ONE)
