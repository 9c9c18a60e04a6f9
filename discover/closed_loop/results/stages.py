"""What a closed loop added or found declared, stage by stage, and without each run."""

from dataclasses import dataclass, field
from typing import Literal

from discover.closed_loop.results.error_pair import ErrorPair
from discover.inference.by_mode.constants import ConstantByMode, StageParameter, ToldTogether

Verdict = Literal["effects_added", "no_effect_needed", "unexplained", "no_signal"]


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
        all declared times does as well, `small_bench_faults` where what all runs share of small
        faults does, and what it is in the limit that is all they show of it.
    error
        Errors after this stage.
    evidence
        Lowering of the information criterion.
    equation, source, check
        What it adds, where that comes from, and how to confirm it in the laboratory.
    left_open
        Names of constants that the runs do not tell.
    told_together
        What they tell of two of these.
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
    left_open: tuple[str, ...] = field(default=(), kw_only=True)
    told_together: tuple[ToldTogether, ...] = field(default=(), kw_only=True)


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
