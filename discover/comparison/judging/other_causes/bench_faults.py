"""What is off on a bench in all runs alike, and a law as it fits the runs beside it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

SMALLEST = 1e-3
"""Of a fault, relative, that is told."""


def _of_sign(size: float) -> str:
    return "more" if size > 0 else "less"


@dataclass(frozen=True)
class Faults:
    """What is off in all runs alike.

    Attributes
    ----------
    rate, time, stress
        Of the rates, of the relaxation times, and of the moduli or of the stress that is shown: by
        how much they are more than told, relative.
    compliance
        Of the tool, times the modulus: strain per stress over that of the fluid.
    late
        By how much each stress is told too late, in s.
    """

    rate: float = 0.0
    time: float = 0.0
    stress: float = 0.0
    compliance: float = 0.0
    late: float = 0.0

    @property
    def text(self) -> str:
        """The same as a clause, without what is less than a thousandth."""
        sizes = {
            "rates": self.rate,
            "relaxation times": self.time,
            "moduli, or the stresses that are shown,": self.stress,
        }
        found = [
            f"{what} are {100 * abs(size):.2g} % {_of_sign(size)} than told"
            for what, size in sizes.items()
            if abs(size) >= SMALLEST
        ]
        if abs(self.compliance) >= SMALLEST:
            share = f"{100 * abs(self.compliance):.2g} %"
            found.append(f"the tool yields by {share} {_of_sign(self.compliance)} than told")
        if self.late:
            sense = "late" if self.late > 0 else "early"
            found.append(f"stresses are told {abs(self.late):.2g} s too {sense}")
        return ", ".join(found) or "nothing is off"


@dataclass(frozen=True)
class OnBench:
    """A law as it fits the runs best, faults of the bench among its constants.

    Attributes
    ----------
    coefficients
        By the spelling of its terms: the value, and the ends of its 95 % interval.
    faults
        What is off.
    cost
        Minus its log evidence, but for a constant.
    values
        Constants and coefficients, as of `Bench.law`.
    columns, root
        Which of them were fitted, and a root of the covariance of these and, behind them, of what
        is off of the rate.
    """

    coefficients: Mapping[str, tuple[float, float, float]]
    faults: Faults
    cost: float
    values: Float[np.ndarray, " q"]
    columns: Sequence[int]
    root: Float[np.ndarray, "r p"]

    @property
    def text(self) -> str:
        """The law in words."""
        told = (f"{one[0]:.3g} {term}" for term, one in self.coefficients.items())
        return " + ".join(told).replace("-", "−")
