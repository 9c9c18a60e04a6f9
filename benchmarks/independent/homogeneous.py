"""A fluid of several modes in any homogeneous flow, on full tensors, by scipy.

The material here shares nothing with the laws, the algebra or the integrator of the package.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from independent.laws import multimode_giesekus
from independent.material import integrate

# Velocity gradients at unit rate, written out   [Bird, Armstrong & Hassager 1987, section 3.1]
UNIT = {
    "shear": np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]),
    "uniaxial": np.diag([1.0, -0.5, -0.5]),
    "planar": np.diag([1.0, -1.0, 0.0]),
    "biaxial": np.diag([1.0, -2.0, 1.0]),
}


@dataclass(frozen=True)
class GiesekusFluid:
    """Giesekus modes with one mobility, and a solvent   [Giesekus 1982, JNNFM 11, 69].

    `modulus`, `relaxation_time`: of each mode, in Pa and s.
    `mobility`: α of every mode; 0 is upper-convected Maxwell.
    `solvent_viscosity` in Pa s.
    """

    modulus: tuple[float, ...]
    relaxation_time: tuple[float, ...]
    mobility: float
    solvent_viscosity: float = 0.0

    def recorded(self, kind: str, *flow, **more) -> np.ndarray:
        """Return σ12 in shear, σ11 − σ22 in extension, in Pa; parameters as of `stress`."""
        total = self.stress(kind, *flow, **more)
        return total[:, 0, 1] if kind == "shear" else total[:, 0, 0] - total[:, 1, 1]

    def stress(
        self, kind: str, rate: Callable[[float], float], times: np.ndarray, begins: float = 0.0,
        jumps: Sequence[float] = (),
    ) -> np.ndarray:  # fmt: skip
        """Return the extra stress in Pa, shape (n, 3, 3).

        `kind`: one of `UNIT`. `rate` in 1/s, of time in s. `times`: increasing, after `begins`,
        when the fluid is at rest. `jumps`: times at which the rate jumps.
        """
        law = multimode_giesekus(
            [self.mobility] * len(self.modulus), self.modulus, self.relaxation_time
        )
        states = integrate(
            lambda t, y: law.change(y, UNIT[kind] * rate(t + begins)), law.rest(), times - begins,
            [jump - begins for jump in jumps], law.scale(),
        )  # fmt: skip
        gradients = np.array([UNIT[kind] * rate(t) for t in times])
        total = np.array([law.stress(state, 0.0) for state in states])
        return total + self.solvent_viscosity * (gradients + np.swapaxes(gradients, 1, 2))
