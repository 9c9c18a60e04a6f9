"""Priors of constants: what is known of each before the data."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from jaxtyping import Float, Int
from scipy.special import gammaln

Kind = Literal["normal", "amplitude", "logarithm"]


@dataclass(frozen=True)
class Prior:
    """What is known of one constant.

    `kind`: ``normal``: about `middle` with the standard deviation `width`. ``amplitude``: Cauchy
    about zero, for what is mostly small and may be large   [Gelman 2006, Bayesian Anal. 1, 515].
    ``logarithm``: the logarithm is normal about that of `middle`, with the deviation `width`.
    `low`, `high`: ends of the physical range, in the unit of the constant.
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


class Priors(dict[int, Prior]):
    """Priors of all that is free, by position in the constants, as arrays too."""

    @cached_property
    def positions(self) -> Int[np.ndarray, " free"]:
        """Positions of what is free."""
        return np.array([*self], int)

    @cached_property
    def centres(self) -> Float[np.ndarray, " free"]:
        """Middles of the coordinates."""
        return np.array([prior.centre for prior in self.values()])

    @cached_property
    def widths(self) -> Float[np.ndarray, " free"]:
        """Standard deviations, or the scale of an amplitude."""
        return np.array([prior.width for prior in self.values()])

    @cached_property
    def ends(self) -> Float[np.ndarray, "free 2"]:
        """Ends of the coordinates."""
        return np.array([prior.ends for prior in self.values()]).reshape(-1, 2)

    @cached_property
    def range(self) -> Float[np.ndarray, "free 2"]:
        """Ends of the constants."""
        return np.array([(prior.low, prior.high) for prior in self.values()]).reshape(-1, 2)

    @cached_property
    def _logarithms(self) -> np.ndarray:
        return np.flatnonzero([prior.is_logarithm for prior in self.values()])

    @cached_property
    def _are_amplitudes(self) -> np.ndarray:
        return np.array([prior.kind == "amplitude" for prior in self.values()], bool)

    @cached_property
    def _constant(self) -> float:
        """What of the log density does not depend on the coordinates."""
        sided = np.any(self.ends == self.centres[:, None], axis=1)
        scales = np.where(self._are_amplitudes, np.pi, np.sqrt(2.0 * np.pi))
        return float(np.sum(sided) * np.log(2.0) - np.sum(np.log(scales * self.widths)))

    def coordinates(self, theta: Float[np.ndarray, "*trials p"]) -> Float[np.ndarray, "*trials n"]:
        """Return the coordinates that are fitted, of the constants."""
        values, logs = theta[..., self.positions], self._logarithms
        if len(logs):
            values[..., logs] = np.log(values[..., logs])
        return values

    def placed(
        self, theta: Float[np.ndarray, " p"], coordinates: Float[np.ndarray, "*trials n"]
    ) -> Float[np.ndarray, "*trials p"]:
        """Return the constants at other coordinates of what is free."""
        values, logs = coordinates.copy(), self._logarithms
        if len(logs):
            values[..., logs] = np.exp(values[..., logs])
        found = np.broadcast_to(theta, (*values.shape[:-1], len(theta))).copy()
        found[..., self.positions] = values
        return found

    def log_density(self, coordinates: Float[np.ndarray, "*trials n"]) -> Float[Any, "*trials"]:
        """Return the log density of the coordinates."""
        square = ((coordinates - self.centres) / self.widths) ** 2
        logs = np.where(self._are_amplitudes, np.log1p(square), 0.5 * square)
        return self._constant - np.sum(logs, axis=-1)

    def pulls(self, coordinates: Float[np.ndarray, " free"]) -> Float[np.ndarray, "free 2"]:
        """Return the derivatives of the log density, and curvatures that bound it."""
        off, square = coordinates - self.centres, self.widths**2
        curvature = np.where(self._are_amplitudes, 2.0 / (square + off**2), 1.0 / square)
        return np.column_stack([-curvature * off, curvature])


@dataclass(frozen=True)
class Deviations:
    """What is known of deviations about zero that have one common size.

    `size`: their standard deviation, or its usual value where it is not known. `known`: degrees of
    freedom by which it is: the square of the standard deviation is size²·known/χ², and integrated
    out   [Gelman et al. 2013, Bayesian Data Analysis, ch. 5].
    """

    size: float
    known: float = np.inf

    def log_density(self, values: Float[np.ndarray, "*trials n"]) -> Float[Any, "*trials"]:
        """Return the log density of all deviations together."""
        n, square = values.shape[-1], np.sum(values**2, axis=-1) / self.size**2
        if not np.isfinite(self.known):
            return -0.5 * square - n * float(np.log(self.size) + 0.5 * np.log(2.0 * np.pi))
        known = self.known
        factor = gammaln(0.5 * (known + n)) - gammaln(0.5 * known)
        factor -= n * (np.log(self.size) + 0.5 * np.log(np.pi * known))
        return factor - 0.5 * (known + n) * np.log1p(square / known)

    def width(self, values: Float[np.ndarray, " n"], least: Any = 0.0) -> Any:
        """Return the standard deviation that such deviations tell of.

        `least`: times the usual size, for where they do not tell yet.
        """
        if self.known == np.inf:
            return self.size
        square = self.known * self.size**2 + float(values @ values)
        return np.maximum(np.sqrt(square / (self.known + len(values))), least * self.size)

    def log_odds_of_size(self, width: float) -> float:
        """Return the log density of a standard deviation, over that of the usual one."""
        if not np.isfinite(self.known):
            return 0.0
        ratio = width / self.size
        return float(-self.known * (np.log(ratio) + 0.5 / ratio**2 - 0.5))
