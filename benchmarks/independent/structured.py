"""A Giesekus mode whose time or modulus follows structures that the rate or the stress breaks."""

from dataclasses import dataclass

import numpy as np

from independent.material import Rate, RateLaw


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
        """Return s = 1 and no stress."""
        return np.append(np.ones(len(self.times)), np.zeros(9))

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return ds/dt and dA/dt of the stress G A."""
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
        """Return G A, or s G A."""
        levels, a = np.split(state, [len(self.times)])
        share = self._whole(levels) if self.in_modulus else 1.0
        return share * self.modulus * a.reshape(3, 3)
