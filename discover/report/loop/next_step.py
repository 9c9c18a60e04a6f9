"""What to measure next after a closed loop."""

from collections.abc import Sequence

import numpy as np

from discover.loop.loop_result import LoopResult
from discover.loop.parts import Stage
from discover.report.loop.asked import EXPLAINED, several, untested_by
from discover.report.wording import (
    A_TRANSIENT,
    FIGURE_SYMBOLS,
    IF_LOADINGS,
    effect_title,
    effects_title,
    percent,
    significant,
)


def what_to_measure_next(result: LoopResult) -> str:
    """Return what would tell most: more samples, a check of an effect, another test."""
    rates = [float(np.max(np.abs(record.rate))) for record in result.records]
    faster = f"a shear rate above {significant(max(rates, default=0.0), 3)} 1/s"
    if result.verdict == "no_signal":
        return (
            "See that the sensor is connected and the sample there, and measure where the stress "
            "stands out of the noise: with a larger sample, a more sensitive transducer, or "
            f"{faster}."
        )
    untested = untested_by(result)
    if untested == "states":
        return A_TRANSIENT
    if result.verdict in EXPLAINED and (told := _telling_test(result)):
        return told
    if untested:
        return "Fit another run, or hold one out: at another rate, or of another test."
    doubtful = _most_doubtful(result.stages)
    if doubtful is not None and result.verdict != "unexplained":
        check = doubtful.check.rstrip(". ")
        if not check[1:2].isdigit():  # N2 keeps its capital
            check = check[:1].lower() + check[1:]
        title = effect_title(doubtful.effect)
        if not doubtful.aliases:
            return f"To confirm {title}: {check}."
        others = several([*map(effect_title, doubtful.aliases)], "and")
        return f"To tell {title} from {others}: {check}."
    if result.verdict == "unexplained":
        return (
            "Repeat one run with another geometry or instrument: what changes is the instrument's, "
            f"what stays is the fluid's.{_loadings(result)}"
        )
    hidden = max(result.noise_floor, float(result.remaining.get("linear_error", 0.0)))
    return (
        f"What changes the stress by less than {percent(max(hidden, 1e-5))} may still hide; what "
        f"tests the model hardest is a faster flow: {faster}."
    )


def _loadings(result: LoopResult) -> str:
    """Return that runs may be loadings of their own, where nobody said so of several."""
    runs = [record for record in result.records if not record.held_out]
    told = "loading_deviation" in result.remaining
    if told or len(runs) < 2 or any(run.control == "stress" for run in runs):
        return ""
    return f" {IF_LOADINGS.format('loop')}"


def _telling_test(result: LoopResult) -> str:
    """Return the test that tells the likeliest explanation from others; empty if none does."""
    following = result.next_tests
    best = following.best
    if best is None:
        return ""
    titles = [effects_title(effects) for effects in following.explanations]
    first, *_ = best.pairs
    chosen = first[0]
    others = several([titles[j] for i, j in best.pairs if i == chosen], "and")
    what = f" ({FIGURE_SYMBOLS[best.quantity]})" if best.quantity != "sigma12" else ""
    count = len(following.tests)
    return f"To tell {titles[chosen]} from {others}: {best.title}{what}, of {count} tests weighed."


def _most_doubtful(stages: Sequence[Stage]) -> Stage | None:
    """Return the stage to confirm first: one with aliases before one without."""
    with_aliases = [stage for stage in stages if stage.aliases]
    return next(iter([*with_aliases, *stages]), None)
