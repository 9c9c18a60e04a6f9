"""What a closed loop asks of its result in sentences: doubt, tests, what to measure next."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from discover.answer.sentences import A_TRANSIENT
from discover.loop.parts import Stage
from discover.words import FIGURE_SYMBOLS, effect_title, effects_title, significant

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


def what_to_measure_next(result: Any) -> str:
    """Return what would say most: more signal, a check of an effect, another test."""
    rates = [float(np.max(np.abs(record.rate))) for record in result.records]
    faster = f"a shear rate above {significant(max(rates, default=0.0), 3)} 1/s"
    if result.verdict == "no_signal":
        return (
            "Check that the sensor is connected and the sample loaded; use a larger sample, a more "
            f"sensitive transducer, or {faster}."
        )
    if result.material is not None:
        return result.stages[0].check
    untested = untested_by(result)
    if untested == "states":
        return A_TRANSIENT
    if result.verdict in EXPLAINED and (told := _telling_test(result)):
        return told
    if untested:
        return "Fit another run, or hold one out: at another rate, or of another test."
    if result.verdict == "unexplained":
        return "Repeat one run with another geometry, to separate instrument and fluid."
    doubtful = _most_doubtful(result.stages)
    if doubtful is None:
        return f"Measure {faster}: it tests the model hardest."
    check = doubtful.check.rstrip(". ")
    if not check[1:2].isdigit():  # N2 keeps its capital
        check = check[:1].lower() + check[1:]
    title = effect_title(doubtful.effect)
    if not doubtful.aliases:
        return f"To confirm {title}, {check}."
    others = several([*map(effect_title, doubtful.aliases)], "and")
    return f"To distinguish {title} from {others}, {check}."


def _telling_test(result: Any) -> str:
    """Return the test that distinguishes the likeliest explanation from others; empty if none."""
    following = result.next_tests
    best = following.best
    if best is None:
        return ""
    titles = [effects_title(effects) for effects in following.explanations]
    first, *_ = best.pairs
    chosen = first[0]
    others = several([titles[j] for i, j in best.pairs if i == chosen], "and")
    what = f" ({FIGURE_SYMBOLS[best.quantity]})" if best.quantity != "sigma12" else ""
    title = f"{best.title[:1].upper()}{best.title[1:]}"
    return f"{title}{what}: it should distinguish {titles[chosen]} from {others}."


def _most_doubtful(stages: Sequence[Stage]) -> Stage | None:
    """Return the stage to confirm first: one with aliases before one without."""
    with_aliases = [stage for stage in stages if stage.aliases]
    return next(iter([*with_aliases, *stages]), None)
