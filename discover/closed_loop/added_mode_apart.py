"""Laws with constants by mode, where a search found the second mode, as rivals of what it named.

A fluid of one declared mode has one constant of each law, and a mode that the search adds shares
it. Two modes with constants of their own are then told as a mode and something else of the fluid,
such as a structure. So each law by mode is asked in the place of any of the other effects.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from discover.closed_loop.modes_apart import places_in, prior_in
from discover.closed_loop.search import Search
from discover.closed_loop.search.scoring.physical_range import at_an_end
from discover.effects import AbstractEffect, LibraryTerm, ModeEffect
from discover.forward import AugmentedModel
from discover.forward.declared import may_differ_by_mode
from discover.inference.by_mode.degrees import Degree
from discover.inference.evidence import INDISTINGUISHABLE
from discover.inference.least_squares import Fit
from discover.inference.problem import FitProblem, effect_of

_STEPS = (-1.0, 1.0)
"""From where a law of each mode starts: by so much, on the link's scale, for each decade."""


@dataclass(frozen=True)
class LawByMode:
    """A law by mode beside some effects, which explains the runs about as well as what was found.

    Attributes
    ----------
    model
        The declared model, in which constants may differ from mode to mode, with what was asked.
    name
        Of the constant that differs: a parameter of the law, or an effect.
    effects
        Beside the declared model, that of the law among them.
    fit
        Of these, linear in log λ.
    is_likelier
        Whether it is likelier than what was found.
    """

    model: AugmentedModel
    name: str
    effects: tuple[str, ...]
    fit: Fit
    is_likelier: bool


def law_by_mode_instead(
    search: Search, max_effects: int, scales: Mapping[str, float]
) -> LawByMode | None:
    """Return the likeliest law by mode beside the mode that a search found, if it is a rival.

    It is one if it explains the runs with fewer effects and is not much less likely
    (`INDISTINGUISHABLE`), or with the same ones and is as much likelier. Where what was found does
    not explain the runs, it has to be as much likelier, and to explain them.

    Parameters
    ----------
    search
        A finished search in a fluid of one declared mode.
    max_effects
        Largest number of effects.
    scales
        Of the data, as the model of the search has them.
    """
    problem, rivals = _rivals(search, max_effects, scales)
    if not rivals:
        return None
    # counted on what the best fit leaves: a misfit passes for noise that is correlated
    closest = min([search.fit, *(fit for *_, fit in rivals)], key=lambda fit: fit.cost)
    effective = search.problem.independent_samples(closest)
    own = search.problem.worth(search.fit, search.active, effective)
    explained, best, least = search.explained, None, np.inf
    for name, effects, fit in rivals:
        worth = problem.worth(fit, effects, effective)
        # of what was found alone, one constant for all modes is the simpler
        simpler = explained and not set(effects) >= set(search.active)
        limit = own + (INDISTINGUISHABLE if simpler else -INDISTINGUISHABLE)
        if worth < min(limit, least):
            best = LawByMode(problem.model, name, tuple(effects), fit, worth < own)
            least = worth
    if best is None or explained:
        return best
    return best if search.tolerated.left(best.fit.residual).verdict == "explained" else None


def has_second_mode(search: Search) -> bool:
    """Return whether a search in a fluid of one declared mode has another, found or known.

    Of several kinds of effects that add modes nobody knows which is whose, so there may be but one.
    """
    before, declared = search.model, search.model.declared
    present = {*search.active, *(one.name for one in declared.effects)}
    modes = {e.name for e in before.effects if isinstance(e, ModeEffect)}
    single = len(declared.modulus) == 1 and not declared.by_mode and len(modes) == 1
    return single and bool(present & modes)


def _rivals(
    search: Search, max_effects: int, scales: Mapping[str, float]
) -> tuple[FitProblem, list[tuple[str, list[str], Fit]]]:
    """Return constants by mode, each with the effects beside it, and their fits; and of what.

    Beside what is asked there are no other effects in the model: its program compiles fast.
    """
    before, declared = search.model, search.model.declared
    modes = [e.name for e in before.effects if isinstance(e, ModeEffect)]
    laws = _laws(search)
    names = [*(p.name for p in declared.free_parameters), *laws]
    if not names or not has_second_mode(search):
        return search.problem, []
    apart = replace(declared, by_mode=tuple(names), added_modes=1)
    asked = dict.fromkeys([*search.active, *laws])
    model = AugmentedModel(apart, [effect_of(before, name) for name in asked], scales)
    places = places_in(before, model, search.active)
    prior = prior_in(search.prior, places)
    problem = FitProblem(model, search.batch, search.n_candidates, prior)
    found = model.zero()
    found[[*places.values()]] = search.fit.theta[[*places]]
    owners, starts, free = [], [], []
    for name, effects in _sets(search, modes[0], names, laws, max_effects):
        theta, positions = _start(model, found, search.active, effects)
        first = model.varying(name)[0]
        for step in _STEPS:
            start = theta.copy()
            start[first] = step
            owners.append((name, effects))
            starts.append(start)
            free.append((*positions, first))
    fits = problem.fits(starts, free, rivals=True)
    return problem, [
        (name, effects, fit)
        for (name, effects), fit in zip(owners, fits, strict=True)
        if fit.usable and not at_an_end(model, fit.theta, effects)
    ]


def start_from(search: Search, before: Search, found: LawByMode) -> None:
    """Let a search begin with a law by mode, and know what another fitted that led to it.

    It begins with what that other found where this is likelier, and knows the law by mode then.

    Parameters
    ----------
    search
        A search from the declared model of `found`, which has started.
    before
        The one before.
    """
    model = search.model
    places = places_in(before.model, model, [effect.name for effect in before.model.effects])
    search.known = {places[at]: known for at, known in before.known.items()}
    search.established = before.established
    search.rankings = list(before.rankings)
    own = {*found.effects, *before.active}
    search.refused = before.refused - own
    search.left_open = before.left_open - own
    search.not_named = {n: text for n, text in before.not_named.items() if n not in own}
    search.seen.take_over(before.seen, places)
    search.degrees = {name: Degree() for name in search.degrees}
    theta = model.zero()
    theta[[*places.values()]] = before.fit.theta[[*places]]
    search.take(search.fitted(before.active, theta), before.active)
    search.weigh_each_effect()
    theta, size = model.zero(), model.declared.size
    places = places_in(found.model, model, found.effects)
    theta[[*places.values()]] = found.fit.theta[[*places]]
    theta[:size] = found.fit.theta[:size]
    search.degrees[found.name] = Degree(1)
    fit = search.fitted(found.effects, theta)
    possible = fit.usable and search.predicts_held_out(fit.theta)
    if possible:
        search.seen.note(found.effects, fit, search.problem.weight)
    if not (possible and found.is_likelier):
        search.degrees[found.name] = Degree()
        return
    search.take(fit, found.effects)
    search.choose_degrees()
    search.take(search.fit, found.effects)
    search.weigh_each_effect()


def _laws(search: Search) -> list[str]:
    """Return the effects whose constant may differ by mode: those found, and others with a name."""

    def asked(effect: AbstractEffect) -> bool:
        if not may_differ_by_mode(effect):
            return False
        named = not isinstance(effect, LibraryTerm) and search.admitted(effect)
        return effect.name in search.active or named

    known = {one.name for one in search.model.declared.effects}
    return [e.name for e in search.model.effects if asked(e) and e.name not in known]


def _sets(
    search: Search, mode: str, names: Sequence[str], laws: Sequence[str], max_effects: int
) -> list[tuple[str, list[str]]]:
    """Return each constant by mode with the effects beside it: the mode and some of those found."""
    found = []
    for name in names:
        law = [name] if name in laws else []
        added = [one for one in (mode, *law) if one == name or one in search.active]
        others = [one for one in search.active if one not in added]
        kept = [one for one in others if one in search.established]
        others = [one for one in others if one not in kept]
        for count in range(len(others) + 1):
            for more in combinations(others, count):
                effects = [*added, *kept, *more]
                if len(effects) <= max(max_effects, len(search.active)):
                    found.append((name, effects))
    return found


def _start(
    model: AugmentedModel, found: np.ndarray, active: Sequence[str], effects: Sequence[str]
) -> tuple[np.ndarray, list[int]]:
    """Return parameters with some effects, those found as they are, and what is fitted of them."""
    theta = found.copy()
    for effect in model.effects:
        at = model.positions(effect.name)
        if effect.name in active and effect.name not in effects:
            theta[at] = model.zero()[at]
        elif effect.name in effects and effect.name not in active:
            theta[at] = model.first_trial[at]
    own = [at for name in effects for at in model.positions(name)]
    return theta, [*model.free_positions, *own]
