"""Effects of a model asked again, whether another serves better in the place of one."""

import numpy as np

from discover.closed_loop.results.candidate_score import CandidateScore
from discover.closed_loop.search.current_model import LEADERS, CurrentModel
from discover.closed_loop.search.scoring.attribution import attribute
from discover.closed_loop.search.scoring.left_out import left_out_errors
from discover.closed_loop.search.scoring.physical_range import at_an_end
from discover.closed_loop.search.scoring.refitting import Choice, aliases_of, refit, simplest
from discover.effects import AbstractEffect
from discover.inference.evidence import BARE_MENTION

_COMPARED = 16


def reexamine(search: CurrentModel) -> bool:
    """Ask of each effect but the last whether another serves better now; say if one does.

    An effect was chosen when those after it were still missing, and may have stood for a part
    of them. Another serves better if it has more evidence and predicts runs left out better.
    What was settled at small strain gives way only where the whole is then explained, for the
    misfit of a law still missing cannot judge the instrument, and only to what gains more than
    small strains said for it.
    """
    asked = list(search.active)
    if search.active and not search.established:
        asked = [name for name in asked if name != search.active[-1]]
    exchanged = False
    for name in asked:
        exchanged |= exchange(search, name)
    return exchanged


def ask_for_aliases(search: CurrentModel, name: str) -> None:
    """Refit the final model with each leading candidate in the place of an effect."""
    own, choices = in_place_of(search, name)
    if own is not None:
        search.aliases[name] = aliases_of(own, choices)
        search.without_aliases.discard(name)


def in_place_of(search: CurrentModel, name: str) -> tuple[Choice | None, list[Choice]]:
    """Return an effect of the model after a refit, and with it all that could be instead.

    None where its own refit fails, or where the law runs away without it: then nothing can be
    ranked from there.
    """
    without = search.without(name)
    if not without.usable:
        return None, []
    others = [other for other in search.active if other != name]

    def rival(effect: AbstractEffect) -> bool:
        return effect.name != name and search.candidate(effect)

    leading = attribute(search.model, search.batch, without, others, LEADERS, rival).leading
    current = CandidateScore(name, "", 1.0, 0.0, start=search.fit.theta.copy())
    asked = [current, *leading][:_COMPARED]
    choices = search.possible(refit(search.problem, without, asked), others)
    return next((c for c in choices if c.candidate is current), None), choices


def exchange(search: CurrentModel, name: str) -> bool:
    """Put in the place of an effect what serves better, and return whether anything does."""
    others = [other for other in search.active if other != name]
    own_choice, choices = in_place_of(search, name)
    if own_choice is None:
        return exchange_for_alias(search, name)
    current = own_choice.candidate
    # evidence alone would let a term in that fits a little better and predicts worse
    expected = np.mean(own_choice.left_out)
    able = [c for c in choices if c is own_choice or np.mean(c.left_out) < expected]
    best = simplest(able, search.model)
    if (best.candidate.evidence or 0.0) < (current.evidence or 0.0):
        best = own_choice
    explained = search.tolerated.explained(best.fit, [*others, best.candidate.effect])
    gain = (best.candidate.evidence or 0.0) - (current.evidence or 0.0)
    if name in search.established and not (explained and gain > search.support[name]):
        return False
    search.aliases[name] = aliases_of(best, choices)
    search.without_aliases.discard(name)
    if best.candidate is current:
        return False
    new = best.candidate.effect
    search.aliases[new] = search.aliases.pop(name)
    search.support[new] = search.support.pop(name)
    search.active[search.active.index(name)] = new
    search.without_aliases = {other for other in search.active if other != new}
    search.established = tuple(n for n in search.established if n != name)
    own = search.model.positions(name)
    search.known = {at: value for at, value in search.known.items() if at not in own}
    search.fit = search.sharpened(best.fit)
    search.polish()
    search.fit_path()
    search.leave_out()
    return True


def exchange_for_alias(search: CurrentModel, name: str) -> bool:
    """Put an alias in the place of an effect without which the law runs away; say if one serves.

    What was added later may stand for a difference between the two, and run away where the effect
    does not hold it. So each alias is tried from where it was fitted alone, and the others both as
    they are and from nothing.
    """
    model, problem = search.model, search.problem
    alone = {one.effects[0]: one for one in search.seen if len(one.effects) == 1}
    candidates = {effect.name for effect in model.effects if search.candidate(effect)}
    effective = problem.independent_samples(search.fit)

    least = problem.worth(search.fit, search.active, effective) - BARE_MENTION
    best, chosen = None, []
    for alias in search.aliases.get(name, ()):
        if alias in search.active or alias not in alone or alias not in candidates:
            continue
        active = [alias if other == name else other for other in search.active]
        values = alone[alias].theta(model)
        beside = values.copy()
        for other in search.active:
            if other != name:
                at = model.positions(other)
                beside[at] = search.fit.theta[at]
        fit = problem.best_fit([values, beside], search.positions(active))
        if not fit.usable or at_an_end(model, fit.theta, active):
            continue
        worth = problem.worth(fit, active, effective)
        if worth < least and np.mean(left_out_errors(problem, fit)) < search.left_out:
            best, chosen, least = fit, active, worth
    if best is None:
        return False
    new = next(other for other in chosen if other not in search.active)
    search.aliases[new] = (name, *(a for a in search.aliases.pop(name) if a != new))
    search.support[new] = search.support.pop(name)
    search.established = tuple(n for n in search.established if n != name)
    search.take(best, chosen)
    return True
