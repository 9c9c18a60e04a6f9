"""Priors of constants: what is known of each before the data."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float
from scipy.special import gammaln

Kind = Literal["normal", "amplitude", "logarithm"]


@dataclass(frozen=True)
class Prior:
    """What is known of one constant.

    Attributes
    ----------
    kind
        ``normal``: about `middle` with the standard deviation `width`. ``amplitude``: Cauchy about
        zero, for what is mostly small and may be large   [Gelman 2006, Bayesian Anal. 1, 515].
        ``logarithm``: the logarithm is normal about that of `middle`, with the deviation `width`.
    low, high
        Ends of the physical range, in the unit of the constant.
    """

    kind: Kind
    middle: float
    width: float
    low: float = -np.inf
    high: float = np.inf

    @property
    def is_logarithm(self) -> bool:
        """Whether the coordinate that is fitted is the logarithm of the constant."""
        return self.kind == "logarithm"

    def to_coordinate(self, value: float) -> float:
        """Return the coordinate that is fitted, of the constant."""
        return float(np.log(value)) if self.is_logarithm else float(value)

    def to_value(self, coordinate: float) -> float:
        """Return the constant, of the coordinate."""
        return float(np.exp(coordinate)) if self.is_logarithm else float(coordinate)

    @property
    def ends(self) -> tuple[float, float]:
        """Ends of the range of the coordinate."""
        if not self.is_logarithm:
            return self.low, self.high
        low = np.log(self.low) if self.low > 0 else -np.inf
        return float(low), float(np.log(self.high))

    @property
    def centre(self) -> float:
        """Middle of the coordinate."""
        return float(np.log(self.middle)) if self.is_logarithm else self.middle

    def log_density(self, coordinate: float) -> float:
        """Return the log density of the coordinate."""
        off = (coordinate - self.centre) / self.width
        sided = np.log(2.0) if self.low == self.centre or self.high == self.centre else 0.0
        if self.kind == "amplitude":
            return float(-np.log(np.pi * self.width) - np.log1p(off**2) + sided)
        return float(-0.5 * off**2 - np.log(self.width) - 0.5 * np.log(2.0 * np.pi) + sided)

    def pull(self, coordinate: float) -> tuple[float, float]:
        """Return the derivative of the log density, and a curvature that bounds it."""
        off = coordinate - self.centre
        if self.kind == "amplitude":
            curvature = 2.0 / (self.width**2 + off**2)
            return -curvature * off, curvature
        return -off / self.width**2, 1.0 / self.width**2


@dataclass(frozen=True)
class Deviations:
    """What is known of deviations about zero that have one common size.

    Attributes
    ----------
    size
        Their standard deviation, or its usual value where it is not known.
    known
        Degrees of freedom by which it is: the square of the standard deviation is size²·known/χ²,
        and integrated out   [Gelman et al. 2013, Bayesian Data Analysis, ch. 5].
    """

    size: float
    known: float = np.inf

    def log_density(self, values: Float[np.ndarray, " n"]) -> float:
        """Return the log density of all deviations together."""
        n, square = len(values), float(values @ values) / self.size**2
        if not np.isfinite(self.known):
            return -0.5 * square - n * float(np.log(self.size) + 0.5 * np.log(2.0 * np.pi))
        known = self.known
        factor = gammaln(0.5 * (known + n)) - gammaln(0.5 * known)
        factor -= n * (np.log(self.size) + 0.5 * np.log(np.pi * known))
        return float(factor - 0.5 * (known + n) * np.log1p(square / known))

    def width(self, values: Float[np.ndarray, " n"], least: float = 0.0) -> float:
        """Return the standard deviation that such deviations tell of.

        `least`: times the usual size, for where they do not tell yet.
        """
        if not np.isfinite(self.known):
            return self.size
        square = self.known * self.size**2 + float(values @ values)
        return max(float(np.sqrt(square / (self.known + len(values)))), least * self.size)

    def log_odds_of_size(self, width: float) -> float:
        """Return the log density of a standard deviation, over that of the usual one."""
        if not np.isfinite(self.known):
            return 0.0
        ratio = width / self.size
        return float(-self.known * (np.log(ratio) + 0.5 / ratio**2 - 0.5))
