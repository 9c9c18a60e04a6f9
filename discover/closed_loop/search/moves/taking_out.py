"""Effects that were added and are no finding, taken out again."""

from collections.abc import Callable

import numpy as np

from discover.closed_loop.search.current_model import CurrentModel
from discover.closed_loop.search.scoring.mode_dependence import names_not_needed
from discover.closed_loop.search.scoring.physical_range import at_an_end, undetermined
from discover.closed_loop.search.scoring.refitting import drop_undecided
from discover.closed_loop.search.seen_sets import SeenSet
from discover.inference.evidence import WINDOW
from discover.inference.fit_uncertainty import intervals


def drop_what_modes_explain(search: CurrentModel, say: Callable[[str], None]) -> None:
    """Take out effects that constants that differ from mode to mode make needless.

    Asked only where the names would explain the data: elsewhere nobody is to believe them.
    """
    names = [name for name in search.active if name not in search.established]
    if not names or not search.explained:
        return
    needless = names_not_needed(search.problem, search.fit, names)
    if not needless:
        return
    for name in needless:
        search.refused.add(name)
        search.not_named[name] = (
            f"{name} fits, but is not needed where the constants of the law differ from one "
            "relaxation mode to the next"
        )
    left = [name for name in search.active if name not in needless]
    search.take(search.fitted(left, search.fit.theta), left)
    say(f"not needed where constants differ from mode to mode: {', '.join(needless)}")


def refuse(search: CurrentModel) -> str:
    """Take out one effect whose parameters are no finding, and return its name."""
    names = [name for name in reversed(search.active) if name not in search.established]
    if not names:
        return ""
    bounds = intervals(search.model, search.batch, search.fit)
    longest = search.batch.longest
    for name in names:
        reason = at_an_end(search.model, search.fit.theta, [name])
        open_ = (
            "" if reason else undetermined(search.model, search.fit.theta, bounds, name, longest)
        )
        if not (reason or open_):
            continue
        without = search.without(name)
        if not without.usable:
            continue  # it checks a law that runs away without it
        if open_:
            search.left_open.add(name)
        search.not_named[name] = reason or open_
        search.refused.add(name)
        search.take(without, [other for other in search.active if other != name])
        return name
    return ""


def drop_undecided_effects(search: CurrentModel) -> list[str]:
    """Take out effects of which the whole leaves open whether they are there; name them."""
    fit, kept = drop_undecided(search.problem, search.fit, search.active, search.established)
    dropped = [name for name in search.active if name not in kept]
    if dropped:
        search.take(fit, kept)
    return dropped


def restore_left_open(search: CurrentModel) -> str:
    """Put back what was refused for an open constant if what replaced it is far less likely.

    A flow curve shows how far a structure is broken, and not how fast: its constants are no
    finding. That it is there is not excluded by this. Where it explains the runs and what the
    search found without it does not, or with so many more constants that these are beyond Occam's
    window, to name the others would be false. Returns what was put back; empty for nothing.
    """
    if not search.left_open or (search.explained and not search.active):
        return ""
    problem = search.problem
    effective = problem.independent_samples(search.fit)

    def worth(one: SeenSet) -> float:
        return problem.criterion(one.cost, one.free, one.effects, effective)

    own = problem.worth(search.fit, search.active, effective)
    impossible = search.refused - search.left_open
    instead = [
        one
        for one in search.seen
        if search.left_open & set(one.effects) and not impossible & set(one.effects)
    ]
    if not instead:
        return ""
    best = min(instead, key=worth)
    if worth(best) > own - 2.0 * np.log(WINDOW):
        return ""
    fit = search.fitted(list(best.effects), best.theta(search.model))
    if not search.tolerated.explained(fit, best.effects):
        return ""
    search.refused -= set(best.effects)
    search.left_open -= set(best.effects)
    search.take(fit, best.effects)
    return ", ".join(best.effects)
