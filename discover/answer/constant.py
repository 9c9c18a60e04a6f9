"""A constant in words: its letter, the digits that its interval leaves it, and the bound of it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

from discover.effects.base import POWERS_OF_TIME
from discover.equations.markup import plain as plain_signs
from discover.words import LEVEL, estimate, interval, readable, significant

Span = tuple[float, float]
"""Least and largest value."""


@dataclass(frozen=True)
class Constant:
    """Constant of a law or of an effect.

    `value`, `ci95`, `unit`: with its 95 % interval, None for one that was declared; ``"1"`` if
        dimensionless.
    """

    name: str  # as studies spell it, such as ``alpha``
    value: float
    ci95: Span | None = None
    unit: str = "1"
    determined: bool = True  # whether the data determine it
    letter: str = ""  # LaTeX, as the equation of its effect has it
    meaning: str = ""  # in a few words, where its letter is not one of the field
    end: Literal["", "low", "high"] = ""  # of its physical range, where the value is there
    # of each mode, and whether the runs determine it, where it differs from mode to mode
    by_mode: tuple[tuple[float, bool], ...] = ()

    @property
    def over_modes(self) -> Span | None:
        """Least and largest value of modes that the runs determine; None where there is none."""
        told = [value for value, determined in self.by_mode if determined]
        return (min(told), max(told)) if told else None

    def of_mode(self, place: int) -> str:
        """Value of a mode, in brackets where the runs do not determine it; a dash without one."""
        if place >= len(self.by_mode):
            return "–"
        value, determined = self.by_mode[place]
        largest = max(abs(one) for one, _ in self.by_mode)
        text = "0" if abs(value) < _SMALL * largest else significant(value, 2)
        return text if determined else f"({text})"

    @property
    def may_be_zero(self) -> bool:
        """Whether its interval holds zero."""
        return self.ci95 is not None and self.ci95[0] <= 0.0 <= self.ci95[1]

    @property
    def is_term(self) -> bool:
        """Whether it is the coefficient of a term of the library."""
        return "sigma" in self.name or "gammadot" in self.name

    @property
    def reciprocal(self) -> "Constant":
        """Its reciprocal, where the letter is that of one over it: γ̇c rather than 1/γ̇c."""
        ends = self.ci95 or (self.value, self.value)
        is_reciprocal = self.letter.startswith("1/") and self.unit in _RECIPROCAL
        if not is_reciprocal or self.value <= 0.0 or min(ends) < 0.0:
            return self
        low, high = ends
        return replace(
            self,
            value=1.0 / self.value,
            ci95=None if self.ci95 is None else (1.0 / high, 1.0 / low if low else math.inf),
            unit=_RECIPROCAL[self.unit],
            letter=self.letter.removeprefix("1/"),
            end=_OTHER_END[self.end],
        )

    def of_times(self, factor: float) -> "Constant":
        """Return it where all times are a factor of those here."""
        by = factor ** POWERS_OF_TIME.get(self.unit, 0)
        ends = None if self.ci95 is None else (by * self.ci95[0], by * self.ci95[1])
        each = tuple((by * value, determined) for value, determined in self.by_mode)
        return replace(self, value=by * self.value, ci95=ends, by_mode=each)

    @property
    def symbol(self) -> str:
        """Letter of the field, such as α."""
        if self.is_term:
            return readable(self.name)
        name = self.name.rpartition(".")[2]
        if name in _SYMBOLS:
            return _SYMBOLS[name][0]
        letter = self.reciprocal.letter
        return plain_signs(letter) if letter else readable(name.replace("_", " "))

    @property
    def said(self) -> str:
        """What it is, in a few words; empty of a term, and where nobody said."""
        name = self.name.rpartition(".")[2]
        said = self.meaning or _SYMBOLS.get(name, ("", ""))[1]
        return said.removeprefix("inverse ") if self.reciprocal is not self else said

    @property
    def number(self) -> str:
        """Value to as many digits as the interval leaves it, with its unit.

        Of what is not determined that of the best fit, which goes with the other constants.
        """
        if not self.determined:
            return f"{significant(self.reciprocal.value, 2)}{self.reciprocal._unit}"
        if self.over_modes is not None:
            low, high = (significant(end, 2) for end in self.over_modes)
            small = abs(self.over_modes[0]) < _SMALL * abs(self.over_modes[1])
            low = "0" if small else low
            return f"{low if low == high else f'{low}–{high}'}{self._unit}"
        if (other := self.reciprocal) is not self:
            return other.number
        return f"{self._plain(self.value)}{self._unit}"

    @property
    def interval(self) -> str:
        """95 % interval, or a dash, or that it is not determined."""
        if not self.determined:
            return "not determined alone"
        if self.over_modes is not None:
            return "by mode, below"
        if (other := self.reciprocal) is not self:
            return other.interval
        if self.bound:
            return self.bound
        low, high = self.ci95 or (math.nan, math.nan)
        if high == math.inf:
            return f"> {significant(low, 2)}"
        first, last = self._rounded(low), self._rounded(high)
        if first and last:
            return f"{first} to {last}" if low < 0.0 else f"{first}–{last}"
        return interval(self.ci95)

    @property
    def in_equation(self) -> float:
        """Value with the digits that `number` has, three where that needs a power of ten."""
        text = self._rounded(self.value).replace(_MINUS, "-") if self.determined else ""
        return float(text or f"{self.value:.{3 if self.determined else 2}g}")

    @property
    def _unit(self) -> str:
        """Unit as it stands behind a number."""
        return "" if self.unit in ("", "1") else f" {self.unit.replace('^2', '²')}"

    def _plain(self, value: float) -> str:
        """Return a number of this constant without its unit."""
        rest = significant(value, 2) if self.may_be_absent else estimate(value, self.ci95)
        return self._rounded(value) or rest

    def _rounded(self, value: float) -> str:
        """Return a number to two digits of the interval's width; empty where it needs a power.

        And to three digits in all, unless the ends of the interval would be one number.
        """
        if self.ci95 is None or not 0.0 < (width := self.ci95[1] - self.ci95[0]) < math.inf:
            return ""
        largest = max(map(abs, (*self.ci95, self.value)))
        of_width, of_value = (
            math.floor(math.log10(size)) for size in (width, abs(self.value) or largest)
        )
        decimals = min(1 - of_width, max(2 - of_value, -of_width))
        if decimals < 0 and value:  # a small number beside a large one keeps two digits
            decimals = min(max(decimals, 1 - math.floor(math.log10(abs(value)))), 0)
        if not 1e-3 <= largest < 1e5 or decimals > 6:
            return ""
        text = f"{round(value, decimals) + 0.0:.{max(decimals, 0)}f}"
        if self.ci95[0] > 0.0 and not float(text):  # small, but not zero
            return significant(value, 1)
        return text.replace("-", _MINUS)

    @property
    def has_interval(self) -> bool:
        """Whether it was fitted, so that its one value is uncertain."""
        if not self.determined or self.ci95 is None or self.over_modes is not None:
            return False
        return self.ci95[0] < self.ci95[1]

    @property
    def text(self) -> str:
        """Symbol, value and interval."""
        return self.with_interval(f"{LEVEL} ")

    def with_interval(self, level: str) -> str:
        """Return symbol, value and interval, with what stands before the interval."""
        if not self.determined:
            return f"{self.symbol} not determined"
        measured = self.measured(level)
        equals = "" if self.bound else " ="
        return f"{self.symbol}{equals} {measured}"

    def measured(self, level: str) -> str:
        """Return value and interval, with what stands before the interval.

        Of a value near an end of its interval the interval comes first: alone it would look like a
        slip, and no other value goes with the other constants.
        """
        if not self.has_interval:
            return f"{self.number}{'' if self.over_modes is None else ' by mode'}"
        if not self.bound and not self.is_skewed:
            return f"{self.number} ({level}{self.interval})"
        level = f"{level.strip()}, " if level.strip() else ""
        return f"{self.interval}{self.reciprocal._unit} ({level}best fit {self.number})"

    @property
    def best_fit(self) -> str:
        """Symbol and value, which goes with the other constants."""
        return f"{self.symbol} = {self.number}{'' if self.over_modes is None else ' by mode'}"

    @property
    def is_skewed(self) -> bool:
        """Whether the value, the best of all constants together, is near an end of its interval.

        The interval is over all laws that fit as well, in which it may be far from that value.
        """
        one = self.reciprocal  # as it is told
        if not one.has_interval or one.ci95 is None or one.may_be_absent:
            return False
        low, high = one.ci95
        return not _NEAR_END < (one.value - low) / (high - low) < 1.0 - _NEAR_END

    @property
    def may_be_absent(self) -> bool:
        """Whether it is told as the reciprocal of a number that may be zero."""
        ends = self.reciprocal.ci95
        return ends is not None and ends[1] == math.inf

    @property
    def is_poor(self) -> bool:
        """Whether it is not determined, or its interval wider than a factor of three."""
        if self.determined and not self.has_interval:  # declared, or that of each mode
            return False
        low, high = self.ci95 or (0.0, math.inf)
        return not self.determined or high - low > 0.5 * abs(low + high)

    @property
    def bound(self) -> str:
        """Bound that remains of a value at an end of its physical range; empty of one inside."""
        one = self.reciprocal
        low, high = one.ci95 or (0.0, 0.0)
        if one.may_be_absent or not one.at_limit:
            return ""
        sign, value = ("≥", low) if one.end == "high" else ("≤", high)
        return f"{sign} {one._plain(value)}"

    @property
    def at_limit(self) -> bool:
        """Whether its value is at an end of what is physical."""
        return bool(self.end) and self.has_interval


_MINUS = "−"
_OTHER_END: Mapping[str, Literal["", "low", "high"]] = {"": "", "low": "high", "high": "low"}
_SMALL = 1e-3  # Share of the largest of several values below which the least is none
_NEAR_END = 0.1  # Share of an interval at its ends in which a value is not near its middle
_RECIPROCAL = {"s": "1/s", "1/s": "s", "1/Pa": "Pa", "1": "1"}
# Symbol and meaning of constants that no effect has
_SYMBOLS = {
    "modulus_Pa": ("G", "modulus"),
    "relaxation_time_s": ("λ", "relaxation time"),
    "modulus_factor": ("G/G_0", "moduli of the runs over the sweep's; included below"),
    "relaxation_time_factor": (
        "λ/λ_0",
        "times of the runs over the sweep's; included below",
    ),
    "eta_s": ("η_s", "Newtonian viscosity"),
    "L2": ("L²", "extensibility"),
    "stretch_time_ratio": ("θ", "stretch time ratio"),
    "maximum_stretch": ("Λ_m", "maximum stretch"),
    "yield_strain": ("Y", "yield strain"),
    "yield_stress_Pa": ("τ_y", "yield stress"),
    "consistency_Pa_sn": ("K", "consistency"),
    "flow_index": ("n", "flow index"),
    "viscosity_Pa_s": ("η", "viscosity"),
    "zero_shear_viscosity_Pa_s": ("η_0", "zero-shear viscosity"),
    "infinite_shear_viscosity_Pa_s": ("η_∞", "infinite-shear viscosity"),
    "critical_time_s": ("k", "critical time"),
    "sharpness": ("a", "sharpness of the bend"),
    "elastic_modulus_Pa": ("G", "modulus"),
}
