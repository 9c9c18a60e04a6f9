"""A constant as finally fitted: one for all modes, or one for each."""

from dataclasses import dataclass, field
from typing import Literal

_OPEN = 100.0
"""Factor above the value from which on an interval tells nothing: two decades, beyond which records
tell no time   [Davies & Anderssen 1997, J. Non-Newtonian Fluid Mech. 73, 163]."""

_DECADE = 10.0
"""The same on both sides."""

_ROUNDING = 1e-9


@dataclass(frozen=True)
class StageParameter:
    """A parameter of an effect as finally fitted.

    Attributes
    ----------
    value
        That of the effects that were found.
    ci95
        95 % interval over all explanations that have the parameter.
    unit
        Of both.
    at_end
        Which end of its physical range the value is at; empty inside.
    """

    value: float
    ci95: tuple[float, float]
    unit: str
    at_end: Literal["", "low", "high"] = field(default="", kw_only=True)

    @property
    def is_open(self) -> bool:
        """Whether these data leave it open: two decades above it, or a decade on both sides."""
        low, high = self.ci95
        both = 0.0 < low < abs(self.value) / _DECADE and high > _DECADE * abs(self.value)
        return both or high > _OPEN * abs(self.value)

    def is_open_up_to(self, end: float) -> bool:
        """Whether it is open in a range: from two decades below its upper end, to that end."""
        low, high = self.ci95
        # a logarithm there and back errs by a rounding
        at_the_end = high >= (1.0 - _ROUNDING) * end
        return self.is_open or (at_the_end and end > _OPEN * max(low, 0.0))


def end_of_range(value: float, low: float, high: float) -> Literal["", "low", "high"]:
    """Return at which end of a range a value is, but for a rounding; empty inside it."""
    off = _ROUNDING * abs(value)
    return "low" if value <= low + off else "high" if value >= high - off else ""


@dataclass(frozen=True)
class ModeConstant:
    """The constant of one mode.

    Attributes
    ----------
    relaxation_time_s
        Of the mode.
    value, ci95
        The constant with its 95 % interval, given that it is a smooth function of the time;
        without one where it is left open.
    left_open
        Whether these data leave it open: the interval leaves hardly a value out, the runs are as
        well described whatever this mode's constant, or it stands at the upper end of its range.
        What stands here then comes from the other modes and the smooth function alone.
    """

    relaxation_time_s: float
    value: float
    ci95: tuple[float, float] | None
    left_open: bool


@dataclass(frozen=True)
class ConstantByMode(StageParameter):
    """A constant by mode; `value` and `ci95` are those at the mean time.

    Attributes
    ----------
    mean_time_s
        Mean relaxation time by viscosity.
    degree
        3: free in each mode that the runs tell; of earlier results that of a polynomial in log λ.
    evidence
        The last is that over one constant.
    modes
        In the order of the declared modes.
    """

    mean_time_s: float
    degree: int
    evidence: tuple[float, ...]
    modes: tuple[ModeConstant, ...]

    @property
    def values(self) -> tuple[float, ...]:
        """Value of each mode."""
        return tuple(mode.value for mode in self.modes)

    @property
    def span(self) -> tuple[float, float] | None:
        """Least and largest value of the modes that the runs determine; None where none is."""
        told = [mode.value for mode in self.modes if not mode.left_open]
        return (min(told), max(told)) if told else None
