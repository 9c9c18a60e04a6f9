"""A constant as finally fitted: one for all modes, or one for each."""

from dataclasses import dataclass, field
from typing import Literal

_FEW = 3
"""Modes, each of which is told."""

_OPEN = 100.0
"""Factor above the value from which on an interval tells nothing: two decades, beyond which records
tell no time   [Davies & Anderssen 1997, J. Non-Newtonian Fluid Mech. 73, 163]."""

_DECADE = 10.0
"""The same on both sides."""

_ROUNDING = 1e-9

_POLYNOMIAL = 2  # highest degree in log λ


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
    ci95_given_effects
        95 % interval if these effects are the right ones; None where only this one is known.
    at_end
        Which end of its physical range the value is at; empty inside.
    """

    value: float
    ci95: tuple[float, float]
    unit: str
    ci95_given_effects: tuple[float, float] | None = field(default=None, kw_only=True)
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
    other_laws
        Effects which this mode alone may follow instead, as far as these data tell.
    """

    relaxation_time_s: float
    value: float
    ci95: tuple[float, float] | None
    left_open: bool
    other_laws: tuple[str, ...] = ()

    @property
    def width(self) -> float:
        """Width of the interval; infinite where there is none."""
        return float("inf") if self.ci95 is None else self.ci95[1] - self.ci95[0]


@dataclass(frozen=True)
class ConstantByMode(StageParameter):
    """A constant by mode; `value` and `ci95` are those at the mean time.

    Attributes
    ----------
    mean_time_s
        Mean relaxation time by viscosity.
    degree
        Of the polynomial in log λ; 0 for one constant of all modes, 3 where modes that the runs
        tell by themselves are free.
    evidence
        For each degree over one constant.
    modes
        In the order of the declared modes.
    own
        How many modes deviate from the polynomial.
    is_raised
        Whether a lower degree fits these runs as well, and runs held out refute it.
    """

    mean_time_s: float
    degree: int
    evidence: tuple[float, ...]
    modes: tuple[ModeConstant, ...]
    own: int = field(default=0, kw_only=True)
    is_raised: bool = field(default=False, kw_only=True)

    @property
    def n_constants(self) -> int:
        """Number of constants fitted."""
        return 1 + min(self.degree, _POLYNOMIAL) + self.own

    @property
    def told(self) -> list[ModeConstant]:
        """Modes with an interval, the fastest first; of many those known best and least."""
        known = [mode for mode in self.modes if mode.ci95 is not None]
        if len(known) > _FEW:
            known = sorted(known, key=lambda mode: mode.width)[:: len(known) - 1]
        return sorted(known, key=lambda mode: mode.relaxation_time_s)

    @property
    def open_times_s(self) -> list[float]:
        """Relaxation times of the modes that are left open, the fastest first."""
        return sorted(mode.relaxation_time_s for mode in self.modes if mode.ci95 is None)

    @property
    def other_laws(self) -> dict[float, tuple[str, ...]]:
        """Effects which one mode alone may follow instead, by its relaxation time in s."""
        return {mode.relaxation_time_s: mode.other_laws for mode in self.modes if mode.other_laws}
