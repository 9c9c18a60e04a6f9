"""One effect of the fluid in the place of several, beside the instrument's that were found."""

import numpy as np

from discover.closed_loop.search.current_model import CurrentModel
from discover.effects import AbstractEffect

_AS_GOOD = 1.02
"""Error of runs left out, over that of what is replaced, with which the simpler is taken."""


def put_one_law_in_place(search: CurrentModel) -> bool:
    """Put one effect of the fluid in the place of several, if it serves better; say if one does.

    Effects of the fluid are chosen while the instrument's are missing, and two may together bend
    into what neither is. Beside the instrument's as they were found, each candidate is asked
    again, alone. What has fewer constants needs no better fit, but the lower criterion.
    """
    kinds = {effect.name: effect.kind for effect in search.model.effects}
    law = [name for name in search.active if kinds[name] == "constitutive"]
    others = [name for name in search.active if name not in law]
    if len(law) < 2 or not others:
        return False
    problem = search.problem
    bare = problem.at(*problem.without(search.fit, *law))
    if not bare.usable:
        return False

    def rival(effect: AbstractEffect) -> bool:
        return effect.kind == "constitutive" and search.candidate(effect)

    _, choices = search.choices_beside(bare, others, rival)
    effective = problem.independent_samples(search.fit)
    able = [c for c in choices if np.mean(c.left_out) < _AS_GOOD * search.left_out]
    if not able:
        return False
    best = min(able, key=lambda c: problem.worth(c.fit, [*others, c.candidate.effect], effective))
    fit, name = search.sharpened(best.fit), best.candidate.effect
    own = problem.worth(search.fit, search.active, effective)
    if problem.worth(fit, [*others, name], effective) >= own:
        return False
    for old in law:
        search.aliases.pop(old, None)
    search.support[name] = sum(search.support.pop(old, 0.0) for old in law)
    search.aliases[name] = best.candidate.aliases
    search.established = tuple(one for one in search.established if one in others)
    search.take(fit, [*others, name])
    return True
