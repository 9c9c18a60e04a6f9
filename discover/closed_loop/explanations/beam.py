"""Carry several sets of effects beside the one that a search chose.

A search follows one path. What it fitted on the way, and did not choose, is the beginning of other
paths: those that explain the records nearly as well are followed too, the likeliest first, until
none is left within reach or as many stages are spent as explanations were asked for.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from discover.closed_loop.search import Search
from discover.closed_loop.search.scoring.left_out import left_out_errors
from discover.closed_loop.search.scoring.physical_range import at_an_end
from discover.closed_loop.search.seen_sets import SeenSet
from discover.inference.evidence import WINDOW
from discover.inference.least_squares import Fit

BEAM_WIDTH = 8
"""Explanations that are carried side by side, by default."""

_TURNS = 2
"""How often a search goes on from an explanation that is far likelier than its own."""

_SLACK = 2.0  # of the criterion, for fits that only ranked
_TWIN = 1e-3
"""Relative difference of costs up to which two sets may be twins: what a ranking fit leaves open
(`RANKING`)."""


@dataclass(frozen=True)
class Carried:
    """A set of effects that explains the records, fitted to the end.

    Attributes
    ----------
    effects
        In the order of the search for what it chose, else in alphabetical order.
    fit
        Of the set.
    criterion
        Twice the negative logarithm of its weight, but for a constant.
    bench
        Small faults that all runs share and that the fit holds, by what is off, relative.
    left_open
        Standard deviation that these leave open of constants, beside noise, by their position.
    """

    effects: tuple[str, ...]
    fit: Fit
    criterion: float
    bench: Mapping[str, float] = field(default_factory=dict)
    left_open: Mapping[int, float] = field(default_factory=dict)


def carry_and_turn(
    search: Search, max_effects: int, width: int, say: Callable[[str], None]
) -> list[Carried]:
    """Carry what explains as well, and let the search go on from what is far likelier.

    Arguments and result as of `carry`.
    """
    carried = carry(search, max_effects, width, say)
    for _ in range(_TURNS):
        if not turn_to_likelier(search, carried, max_effects):
            break
        say(f"going on from a likelier explanation: {', '.join(search.active)}")
        search.run(max_effects, say)
        carried = carry(search, max_effects, width, say)
    return carried


def carry(
    search: Search,
    max_effects: int,
    width: int = BEAM_WIDTH,
    say: Callable[[str], None] = lambda line: None,
) -> list[Carried]:
    """Return the sets of effects that explain the records, the most probable first.

    Parameters
    ----------
    search
        A search that has ended.
    max_effects
        Largest number of effects in a set.
    width
        How many are carried at most, and how many stages are spent on following them.
    say
        Called with a line of text now and then.
    """
    if width > 1:
        _note_shorter(search)
    own = tuple(search.active)
    search.seen.note(own, search.fit, search.problem.weight)
    effective = search.problem.independent_samples(search.fit)
    # twins of one that was followed lead nowhere else
    followed = [one for one in search.seen if one.effects == tuple(sorted(own))]
    spent = 0
    while spent < width and width > 1:
        ahead = [one for one in _in_window(search, effective) if not _twin(one, followed)]
        if not ahead:
            break
        say(f"following another explanation: {', '.join(ahead[0].effects) or 'no effect'}")
        followed.append(ahead[0])
        spent += _follow(search, ahead[0], max_effects, width - spent)
    return _fitted(search, _in_window(search, effective)[: 2 * width], effective, width)


def turn_to_likelier(search: Search, carried: Sequence[Carried], max_effects: int) -> bool:
    """Let a search go on from an explanation far likelier than its own; say if there is one.

    A path that began with the wrong effect may end where no single exchange leads to the right
    ones, and a neighbour of what it passed by may. It has to be likelier than what is chosen by
    more than Occam's window, with what runs at small strain established, and to predict runs left
    out better, or to be a part of it.
    """
    own = tuple(sorted(search.active))
    chosen = next(one for one in carried if tuple(sorted(one.effects)) == own)
    limit = chosen.criterion - 2.0 * np.log(WINDOW)
    for one in carried:
        if one.criterion >= limit:
            break
        other = _with_established(search, one)
        if other.criterion >= limit or len(other.effects) > max_effects:
            continue
        if _is_sounder(search, other):
            search.take(other.fit, other.effects)
            search.weigh_each_effect()
            search.rounds = 0
            return True
    return False


def _with_established(search: Search, one: Carried) -> Carried:
    """Return an explanation that has the effects that runs at small strain established."""
    missing = [name for name in search.established if name not in one.effects]
    if not missing:
        return one
    effects, theta = (*missing, *one.effects), one.fit.theta.copy()
    at = [position for name in missing for position in search.model.positions(name)]
    theta[at] = search.fit.theta[at]
    fit, problem = search.fitted(effects, theta), search.problem
    criterion = problem.worth(fit, effects, problem.independent_samples(search.fit))
    return Carried(effects, fit, criterion if fit.usable else np.inf)


def _is_sounder(search: Search, other: Carried) -> bool:
    """Return whether an explanation can be, and predicts better or is a part of the chosen one."""
    if at_an_end(search.model, other.fit.theta, other.effects):
        return False
    if set(other.effects) < set(search.active):
        return True
    return bool(np.mean(left_out_errors(search.problem, other.fit)) < search.left_out)


def _note_shorter(search: Search) -> None:
    """Fit the sets that what was found contains: the stages before it, and it less one effect."""
    problem, active = search.problem, search.active
    sets, starts, free = [], [], []
    for n in range(len(active)):
        sets.append(active[:n])
        starts.append(search.path[n])
        free.append(tuple(search.positions(active[:n])))
    for name in active[:-1]:
        theta, positions = problem.without(search.fit, name)
        sets.append([other for other in active if other != name])
        starts.append(theta)
        free.append(positions)
    if not sets:
        return
    for effects, fit in zip(sets, problem.fits(starts, free), strict=True):
        if np.isfinite(fit.cost):
            search.seen.note(effects, fit, problem.weight)


def _in_window(search: Search, effective: float) -> list[SeenSet]:
    """Return the sets that are within reach of the best, the best first."""
    sets = [one for one in search.seen if not search.refused & set(one.effects)]
    problem = search.problem
    worth = {
        one.effects: problem.criterion(one.cost, one.free, one.effects, effective) for one in sets
    }
    limit = min(worth.values()) + 2.0 * np.log(WINDOW) + _SLACK
    return sorted(
        (one for one in sets if worth[one.effects] <= limit), key=lambda one: worth[one.effects]
    )


def _twin(one: SeenSet, followed: Sequence[SeenSet]) -> bool:
    return any(
        one.effects == other.effects
        or (
            len(one.free) == len(other.free)
            and len(one.effects) == len(other.effects)
            and abs(one.cost - other.cost) <= _TWIN * other.cost
        )
        for other in followed
    )


def _follow(search: Search, one: SeenSet, max_effects: int, most: int) -> int:
    """Fit the neighbours of a set: an effect more, or another in the place of each.

    Returns how many stages that took, of `most` at most.
    """
    fit = _fits(search, [one])[0]
    if not fit.usable:
        return 0
    stages, explored = 0, search.seen.explored
    # what leaves noise asks for nothing more
    if (
        len(one.effects) < max_effects
        and one.effects not in explored
        and not search.tolerated.random(fit, one.effects)
    ):
        search.choices_beside(fit, one.effects)  # which notes them
        stages += 1
    for name in one.effects:
        others = tuple(other for other in one.effects if other != name)
        if others in explored or stages >= most:
            continue
        without = search.problem.fit(*search.problem.without(fit, name))
        if without.usable:
            search.choices_beside(without, others)
            stages += 1
    return stages


def _fits(search: Search, sets: Sequence[SeenSet]) -> list[Fit]:
    """Return seen sets, fitted to the end."""
    return search.problem.fits([one.theta(search.model) for one in sets], [s.free for s in sets])


def _fitted(search: Search, sets: Sequence[SeenSet], effective: float, width: int) -> list[Carried]:
    """Return sets fitted to the end that are within reach, what the search chose always among them.

    The most probable first.
    """
    problem = search.problem

    def carried(effects: tuple[str, ...], fit: Fit) -> Carried:
        return Carried(effects, fit, problem.worth(fit, effects, effective))

    chosen = carried(tuple(search.active), search.fit)
    others = [one for one in sets if one.effects != tuple(sorted(search.active))]
    fits = _fits(search, others) if others else []
    found = [carried(one.effects, fit) for one, fit in zip(others, fits, strict=True) if fit.usable]
    limit = min(one.criterion for one in [chosen, *found]) + 2.0 * np.log(WINDOW)
    near = sorted((one for one in found if one.criterion <= limit), key=lambda one: one.criterion)
    return sorted([chosen, *near[: width - 1]], key=lambda one: one.criterion)
