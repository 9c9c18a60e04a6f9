"""What a closed loop added or found declared, stage by stage, and without each run."""

from dataclasses import dataclass, field
from typing import Literal

from discover.closed_loop.results.error_pair import ErrorPair

Verdict = Literal["effects_added", "no_effect_needed", "unexplained", "no_signal"]


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
    """

    value: float
    ci95: tuple[float, float]
    unit: str
    ci95_given_effects: tuple[float, float] | None = field(default=None, kw_only=True)


@dataclass(frozen=True)
class ModeConstant:
    """The constant of one mode.

    Attributes
    ----------
    relaxation_time_s
        Of the mode.
    value, ci95
        The constant with its 95 % interval, given that it is a smooth function of the time (see
        `discover.closed_loop.by_mode`); without one where it is left open.
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
        Of the polynomial in log λ; 0 for one constant of all modes.
    evidence
        For each degree over one constant.
    modes
        In the order of the declared modes.
    """

    mean_time_s: float
    degree: int
    evidence: tuple[float, ...]
    modes: tuple[ModeConstant, ...]


@dataclass(frozen=True)
class Stage:
    """An effect that was added.

    Attributes
    ----------
    effect, kind
        Its name and kind.
    parameters
        Its parameters in the final model.
    aliases
        Effects that these data cannot tell from it, `relaxation_time_factor` where one factor on
        all declared times does as well, and what it is in the limit that is all they show of it.
    error
        Errors after this stage.
    evidence
        Lowering of the information criterion.
    equation, source, check
        What it adds, where that comes from, and how to confirm it in the laboratory.
    """

    effect: str
    kind: str
    parameters: dict[str, StageParameter]
    aliases: tuple[str, ...]
    error: ErrorPair
    evidence: float
    equation: str
    source: str
    check: str


@dataclass(frozen=True)
class KnownParameter:
    """A parameter of an effect that was declared; its 95 % interval, where it was fitted."""

    value: float
    ci95: tuple[float, float] | None
    unit: str


@dataclass(frozen=True)
class DeclaredEffect:
    """An effect that was part of the declared model.

    Attributes
    ----------
    effect, kind
        Its name and kind.
    parameters
        Its parameters in the final model.
    """

    effect: str
    kind: str
    parameters: dict[str, KnownParameter | ConstantByMode]


@dataclass(frozen=True)
class Fold:
    """A loop that left one run out, where each run is held out in turn.

    Attributes
    ----------
    run
        The run left out.
    verdict, effects
        What the loop said of the other runs, and what it added.
    error_before, error_after
        Relative error of the run left out.
    """

    run: str
    verdict: Verdict
    effects: tuple[str, ...]
    error_before: float
    error_after: float
