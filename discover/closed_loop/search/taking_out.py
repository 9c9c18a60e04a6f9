"""Effects that were added and are no finding, taken out again."""

from collections.abc import Callable

from discover.closed_loop.search.augment import drop_undecided
from discover.closed_loop.search.current_model import CurrentModel
from discover.closed_loop.search.mode_dependence import names_not_needed
from discover.closed_loop.search.physical_range import at_an_end, undetermined
from discover.forward.least_squares import (
    intervals,
)


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
        reason = at_an_end(search.model, search.fit.theta, [name]) or undetermined(
            search.model, search.fit.theta, bounds, name, longest
        )
        if not reason:
            continue
        search.not_named[name] = reason
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
