"""How likely another shape would have passed for an effect that takes little away.

What a set of effects leaves is tested against noise, and a misfit below a share of the noise passes
that test. An effect that takes away hardly more than this need not have the right shape: a law that
is a little off somewhere else does as well. One that takes away a hundred times as much has to have
it nearly everywhere.
"""

from collections.abc import Sequence

import numpy as np

from discover.closed_loop.explanations.beam import Carried
from discover.closed_loop.search import Search

_UNSEEN = 45.0
"""Sum of squares, over the variance of the noise, of a smooth misfit that the test of what is left
sees in about half of all draws: 30 to 60 in 280 and 480 samples."""


def most_believed(search: Search, carried: Sequence[Carried]) -> list[float]:
    """Return how probable each set can be at most, by the effect in it that takes least away.

    Where a wrong shape is the best there is, what it leaves, over what it takes away, is about as
    likely to be any number from 0 to 1. So it passes in a share s of
    cases, where s is what may pass unseen over what the effect takes away, both root-mean-square,
    and at even odds before the data the right shape has 1/(1 + s).

    Parameters
    ----------
    search
        That has ended in an explanation.
    carried
        What explains the records.
    """
    problem, model = search.problem, search.model
    starts: dict[tuple[str, ...], np.ndarray] = {}
    for one in carried:
        for left in _less_one(one.effects):
            if left not in starts:
                places = search.positions(left)
                starts[left] = model.zero()
                starts[left][places] = one.fit.theta[places]
    if not starts:
        return [1.0] * len(carried)
    fits = problem.fits([*starts.values()], [search.positions(left) for left in starts])
    cost = {
        left: problem.cost(fit) if fit.usable else np.inf
        for left, fit in zip(starts, fits, strict=True)
    }
    effective = problem.independent_samples(search.fit)

    def most(one: Carried) -> float:
        own = max(problem.cost(one.fit), np.finfo(float).tiny)
        without = min((cost[left] for left in _less_one(one.effects)), default=np.inf)
        least = effective * max(without / own - 1.0, 0.0)
        return 1.0 / (1.0 + float(np.sqrt(_UNSEEN / max(least, _UNSEEN))))

    return [most(one) for one in carried]


def _less_one(effects: Sequence[str]) -> list[tuple[str, ...]]:
    """Return a set without each of its effects in turn, in alphabetical order."""
    return [tuple(sorted(set(effects) - {name})) for name in effects]
