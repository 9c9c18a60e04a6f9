"""Relaxation times that are all wrong by one factor, held against the names that were found.

A spectrum is measured in another test, at a temperature that may differ, on another filling or
another batch. What a factor on all its times leaves of the data looks like an effect: of an upper
convected Maxwell fluid in shear, a slip of s = (1/f − 1)/(Gλ) leaves the same stress at all times.
A factor on all moduli is `stress_gain`, which is a candidate; this one is none, since what to do
about it is to fit the times, and to ask again what is missing.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
from jaxtyping import Float

from discover.closed_loop.explanations.beam import Carried
from discover.closed_loop.judging.judgement import Judgement
from discover.closed_loop.search import Search
from discover.forward.least_squares import Fit
from discover.inference.evidence import BARE_MENTION, INDISTINGUISHABLE
from discover.words import percent_of

FACTOR = "relaxation_time_factor"
"""Among the aliases of an effect, that a factor on all declared times does instead."""

_FACTOR_AT = 1  # of its logarithm, in the parameter vector
_MOST = 4  # sets in which it is tried


@dataclass(frozen=True)
class OtherTimes:
    """A factor on all relaxation times, beside some effects, that explains the records.

    Attributes
    ----------
    factor
        On the declared times.
    effects
        That stay beside it.
    error
        Relative misfit of the fitted runs.
    criterion
        As of `Carried`; the factor counts as an effect.
    theta
        All parameters of the fit.
    """

    factor: float
    effects: tuple[str, ...]
    error: float
    criterion: float
    theta: Float[np.ndarray, " p"]

    @property
    def sentence(self) -> str:
        """What the factor does, and what to do about it."""
        beside = f" and {' and '.join(self.effects)}" if self.effects else ""
        return (
            f"With relaxation times that are all {self.factor:.3g} times the declared ones{beside} "
            f"the fitted runs are missed by {percent_of(self.error)}. A sweep at another "
            "temperature or of another sample does that: look at it, or fit the times along "
            '([model] relaxation_time_s = "fit").'
        )


def other_times(
    search: Search, carried: Sequence[Carried], judgement: Judgement
) -> list[OtherTimes]:
    """Return sets of effects that explain the fitted runs beside a factor on all times.

    Where the runs are explained, the factor takes the place of each effect of each explanation;
    where they are not, it is tried beside what was found, less one effect or not, and beside single
    effects.
    """
    refuted = not judgement.carries_over  # by runs that no fit saw, of which a fit says nothing
    if refuted or _FACTOR_AT in search.fit.free or not (search.active or judgement.structured):
        return []
    tried: dict[tuple[str, ...], tuple[np.ndarray, tuple[int, ...]]] = {}
    for one in carried[:_MOST]:
        for name in one.effects:
            left = tuple(sorted(set(one.effects) - {name}))
            tried.setdefault(left, search.problem.without(one.fit, name))
    if judgement.structured:
        tried.setdefault(tuple(sorted(search.active)), (search.fit.theta, search.fit.free))
        single = sorted((s for s in search.seen if len(s.effects) == 1), key=lambda s: s.cost)
        for seen in islice(single, _MOST):
            tried.setdefault(seen.effects, (seen.theta(search.model), seen.free))
    starts = [theta for theta, _ in tried.values()]
    free = [(*own, _FACTOR_AT) for _, own in tried.values()]
    fits = search.problem.fits(starts, free, rivals=True)
    found = [
        _found(search, effects, fit)
        for effects, fit in zip(tried, fits, strict=True)
        if fit.usable and _inside(search, fit) and search.tolerated.explained(fit, effects)
    ]
    # beside effects that do as well alone the factor does nothing
    alone = {one.effects: _worth(search, one.cost, one.free, one.effects) for one in search.seen}
    return [one for one in found if one.criterion < alone.get(one.effects, np.inf) - BARE_MENTION]


def _inside(search: Search, fit: Fit) -> bool:
    """Return whether a fit stands at no end of what a factor can be."""
    factor = fit.theta[_FACTOR_AT]
    return bool(search.model.low[_FACTOR_AT] < factor < search.model.high[_FACTOR_AT])


def _found(search: Search, effects: tuple[str, ...], fit: Fit) -> OtherTimes:
    worth = _worth(search, search.problem.cost(fit), fit.free, (*effects, FACTOR))
    error = float(np.mean(fit.run_errors))
    return OtherTimes(float(np.exp(fit.theta[_FACTOR_AT])), effects, error, worth, fit.theta)


def _worth(search: Search, cost: float, free: Sequence[int], effects: Sequence[str]) -> float:
    """Return the criterion of a fit as the explanations are weighed: by what the search left."""
    problem = search.problem
    return problem.criterion(cost, free, effects, problem.independent_samples(search.fit))


def weighed_times(
    others: Sequence[OtherTimes], carried: Sequence[Carried], active: Sequence[str]
) -> list[tuple[OtherTimes, float]]:
    """Return sets beside a factor, and how much likelier each is than what was found.

    Those that the records tell from it are left out.
    """
    own = next((one.criterion for one in carried if set(one.effects) == set(active)), np.inf)
    return [
        (one, float(np.exp(0.5 * (own - one.criterion))))
        for one in others
        if abs(one.criterion - own) < INDISTINGUISHABLE
    ]


def compared_with_times(
    judgement: Judgement,
    active: Sequence[str],
    carried: Sequence[Carried],
    others: Sequence[OtherTimes],
) -> tuple[Judgement, tuple[str, ...]]:
    """Return the judgement, and the effects found instead of which the factor does as well.

    Where the factor explains the runs clearly better than what was found, that is no finding.
    """
    if not others:
        return judgement, ()
    best = min(others, key=lambda one: one.criterion)
    own = next(one.criterion for one in carried if set(one.effects) == set(active))
    if judgement.structured or best.criterion < own - INDISTINGUISHABLE:
        return _with_sentence(replace(judgement, structured=True, verdict="unexplained"), best), ()
    # the best last, which stays
    instead = {
        name: one
        for one in sorted(others, key=lambda one: -one.criterion)
        for name in set(active) - set(one.effects)
        if one.criterion < own + INDISTINGUISHABLE
    }
    if instead:
        judgement = _with_sentence(judgement, min(instead.values(), key=lambda one: one.criterion))
    return judgement, tuple(instead)


def _with_sentence(judgement: Judgement, times: OtherTimes) -> Judgement:
    return replace(judgement, description=f"{judgement.description} {times.sentence}")
