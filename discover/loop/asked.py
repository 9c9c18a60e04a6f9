"""Questions that several sentences on a closed loop ask of its result."""

from collections.abc import Sequence
from typing import Any

MOST_NAMES = 3

EXPLAINED = ("effects_added", "no_effect_needed")

_EVEN = 0.5


def several(names: Sequence[str], word: str) -> str:
    """Return the first of several names, and how many more there are."""
    shown = list(names[:MOST_NAMES])
    if more := len(names) - len(shown):
        shown.append(f"{more} more")
    return f" {word} ".join(shown)


def untested_by(result: Any) -> str:
    """Return why no run could have refuted what fits the runs; empty where one could."""
    return str(result.remaining.get("untested") or "") if result.verdict in EXPLAINED else ""


def suspected(result: Any) -> list[Any]:
    """Return the effects that are no part of the fluid, those with a size and the surest first."""
    own = [stage for stage in result.stages if stage.kind != "constitutive"]
    return sorted(own, key=lambda stage: (_may_be_zero(stage), -stage.evidence))


def _may_be_zero(stage: Any) -> bool:
    ends = next((one.ci95 for one in stage.parameters.values()), None)
    return ends is not None and ends[0] * ends[1] <= 0.0


def doubted(result: Any) -> float | None:
    """Return the probability of what was added, where that is less than even; None otherwise.

    Effects each of which is likelier there than not are not doubted, however many others may stand
    with them.
    """
    if result.verdict != "effects_added":
        return None
    told, names = result.explanations, [stage.effect for stage in result.stages]
    own = told.holding(names)
    if own is None or own.probability >= _EVEN:
        return None
    if all(told.inclusion.get(name, 0.0) >= _EVEN for name in names):
        return None
    return own.probability
