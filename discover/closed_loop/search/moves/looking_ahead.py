"""Several effects at once that only together earn their places."""

import numpy as np

from discover.closed_loop.search.current_model import CurrentModel
from discover.closed_loop.search.moves.exchanging import exchange
from discover.closed_loop.search.scoring.left_out import left_out_errors
from discover.closed_loop.search.scoring.refitting import IMPROVEMENT, prune
from discover.inference.evidence import BARE_MENTION


def look_ahead(search: CurrentModel, max_effects: int) -> str | None:
    """Add several effects at once that only together earn their places; return their names.

    While two effects are missing, what the second leaves looks like correlated noise and hides
    the evidence for the first. So the best is taken on trust, and the next; the whole must
    then pay for all its members, and each of them is asked again.
    """
    before, left_out, active = search.fit, search.left_out, list(search.active)
    fit, kept = before, list(active)
    while len(kept) < max_effects:
        _, choices = search.choices_beside(fit, kept)
        if not choices:
            break
        best = max(choices, key=lambda choice: choice.candidate.evidence or -np.inf)
        fit = best.fit
        kept.append(best.candidate.effect)
        added = len(kept) - len(active)
        problem = search.problem
        support = problem.evidence(before, fit, problem.independent_samples(fit), added)
        errors = left_out_errors(problem, fit)
        if added < 2 or support <= BARE_MENTION or np.mean(errors) >= IMPROVEMENT * left_out:
            continue
        fit = search.sharpened(fit)
        search.fit = fit
        search.fit, search.active = prune(search.problem, fit, kept, search.established)
        new = [name for name in search.active if name not in active]
        for name in new:
            search.aliases[name] = ()
            search.support[name] = support / len(new)
        search.fit_path()
        search.leave_out()
        # the first was taken on trust, with the others still missing
        for name in new[:-1]:
            exchange(search, name)
        search.without_aliases = set(search.active)
        return ", ".join(name for name in search.active if name not in active)
    return None
