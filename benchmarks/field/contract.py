"""What a contestant is given and what it returns."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

LAW_NAMES = ("ucm", "johnson_segalman", "giesekus", "ptt_linear", "ptt_exponential")
"""Names a contestant may give a fluid; an equation of another kind has no name here."""

# Velocity gradients at unit rate   [Bird, Armstrong & Hassager 1987, section 3.1]
_UNIT = {"shear": np.eye(3, k=1) * [[1], [0], [0]], "uniaxial": np.diag([1.0, -0.5, -0.5])}


@dataclass(frozen=True)
class Flow:
    """A homogeneous flow from rest at t = 0, of rate `amplitude` · cos(`frequency` · t).

    `name`: of the flow.
    `amplitude`, `frequency`: of the shear rate, or of the Hencky rate, in 1/s and rad/s; frequency
        0 is a start-up.
    `times`: sampling times in s, shape (n,), from 0 on.
    `kind`: simple shear or uniaxial extension.
    """

    name: str
    amplitude: float
    frequency: float
    times: np.ndarray
    kind: Literal["shear", "uniaxial"] = "shear"

    def rate(self, time):
        """Return the rate in 1/s, of the shape of the time."""
        return self.amplitude * np.cos(self.frequency * np.asarray(time, float))

    def gradient(self, time: float) -> np.ndarray:
        """Return L in 1/s, shape (3, 3)."""
        return self.rate(time) * _UNIT[self.kind]


@dataclass(frozen=True)
class Record:
    """One training run in shear.

    `flow`: what was imposed.
    `sigma12`: shear stress in Pa, shape (n,), with noise.
    `stress`: the stress tensor in Pa, shape (n, 3, 3), with noise; only for a contestant that says
        that it sees it, None for the others.
    """

    flow: Flow
    sigma12: np.ndarray
    stress: np.ndarray | None = None


@dataclass(frozen=True)
class Training:
    """All that a contestant is told: records, the linear fluid as one mode, and a seed."""

    records: tuple[Record, ...]
    modulus: float  # Pa
    relaxation_time: float  # s
    seed: int = 0


@dataclass(frozen=True)
class Answer:
    """What a contestant makes of the records.

    `predict`: from a flow to what is predicted in it, each of shape (n,) in Pa: ``sigma12``, ``N1``
        and ``N2`` in shear, ``tensile`` (σ11 − σ22) in extension. A quantity that it says nothing
        of is left out; it raises ArithmeticError, or returns values that are not finite, where its
        equation runs away.
    `law`: one of `LAW_NAMES`, or None if it names none.
    `words`: the equation, as short as it can be said.
    """

    predict: Callable[[Flow], Mapping[str, np.ndarray]]
    law: str | None = None
    words: str = ""
