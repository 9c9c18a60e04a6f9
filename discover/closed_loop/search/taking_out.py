"""Effects that were added and are no finding, taken out again."""

from collections.abc import Callable

import numpy as np

from discover.closed_loop.search.augment import drop_undecided
from discover.closed_loop.search.current_model import CurrentModel
from discover.closed_loop.search.evidence import WINDOW, criterion
from discover.closed_loop.search.mode_dependence import names_not_needed
from discover.closed_loop.search.physical_range import at_an_end, undetermined
from discover.forward.least_squares import intervals
from discover.statistics.residual import judged_cost, summarise


def hold_against_modes(search: CurrentModel, say: Callable[[str], None]) -> None:
    """Take out effects that constants that differ from mode to mode make needless.

    Asked only where the names would explain the data: elsewhere nobody is to believe them.
    """
    names = [name for name in search.active if name not in search.settled]
    if not names or not search.explained:
        return
    needless = names_not_needed(search.model, search.batch, search.fit, names, search.prior)
    if not needless:
        return
    for name in needless:
        search.refused.add(name)
        search.not_named[name] = (
            f"{name} fits, but is not needed where the constants of the law differ from one "
            "relaxation mode to the next"
        )
    search.active = [name for name in search.active if name not in needless]
    search.unasked = set(search.active)
    search.fit = search.fitted(search.active, search.fit.theta)
    search.fit_path()
    search.leave_out()
    say(f"not needed where constants differ from mode to mode: {', '.join(needless)}")


def refuse(search: CurrentModel) -> str:
    """Take out one effect whose parameters are no finding, and return its name."""
    names = [name for name in reversed(search.active) if name not in search.settled]
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
        if open_:
            search.left_open.add(name)
        search.not_named[name] = reason or open_
        search.refused.add(name)
        search.fit = search.without(name)
        search.active.remove(name)
        search.unasked = set(search.active)
        search.fit_path()
        search.leave_out()
        return name
    return ""


def drop_undecided_effects(search: CurrentModel) -> list[str]:
    """Take out effects of which the whole leaves open whether they are there; name them."""
    fit, kept = drop_undecided(
        search.model, search.batch, search.fit, search.active, search.n_candidates, search.settled,
        search.prior,
    )  # fmt: skip
    dropped = [name for name in search.active if name not in kept]
    if dropped:
        search.fit, search.active = fit, kept
        search.unasked = set(kept)
        search.fit_path()
        search.leave_out()
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
    weight = np.asarray(search.batch.weight)
    effective = summarise(search.fit.residual, weight).effective_samples

    def worth(cost: float, free: int, effects: int) -> float:
        return criterion(cost, free, effects, effective, search.n_candidates)

    cost = judged_cost(search.fit.residual, weight)
    own = worth(cost, len(search.fit.free), len(search.active))
    impossible = search.refused - search.left_open
    instead = [
        one
        for one in search.seen
        if search.left_open & set(one.effects) and not impossible & set(one.effects)
    ]
    if not instead:
        return ""
    best = min(instead, key=lambda one: worth(one.cost, len(one.free), len(one.effects)))
    if worth(best.cost, len(best.free), len(best.effects)) > own - 2.0 * np.log(WINDOW):
        return ""
    fit = search.fitted(list(best.effects), best.theta(search.model))
    if not search.tolerated.explained(fit, best.effects):
        return ""
    search.refused -= set(best.effects)
    search.left_open -= set(best.effects)
    search.active = list(best.effects)
    search.unasked = set(search.active)
    search.fit = fit
    search.fit_path()
    search.leave_out()
    return ", ".join(best.effects)
