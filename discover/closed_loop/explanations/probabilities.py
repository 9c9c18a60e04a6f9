"""Probabilities of explanations, and of none of them."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from discover.closed_loop.explanations.beam import Carried
from discover.closed_loop.judging.judgement import Judgement
from discover.closed_loop.results.error_pair import ErrorPair
from discover.closed_loop.results.explanation import Explanation, Explanations
from discover.forward import AugmentedModel
from discover.statistics.noise.whiteness import SIGNIFICANCE
from discover.statistics.residual import STRUCTURE
from discover.statistics.unseen import CARRIED

_CERTAIN = float(np.log(1000.0))
"""Logarithm of odds beyond which no test of noise is to be believed."""

_SAME = 0.01
"""Two fits are twins if they differ by less than this fraction of what is left, in mean squares."""


def explanations_of(
    model: AugmentedModel,
    carried: Sequence[Carried],
    errors: Sequence[ErrorPair],
    judgement: Judgement,
    effective_samples: float,
    unlisted: float,
    limits_of: Callable[[Carried], Mapping[str, str]],
    believed: Callable[[Carried], float],
    most: Sequence[float],
) -> Explanations:
    """Return the probabilities of what was carried, twins merged, the likeliest first.

    Parameters
    ----------
    model
        With all candidates.
    carried, errors
        Sets of effects, and the errors of each.
    judgement
        Of what the search chose; the explanations together are believed as far as that is.
    effective_samples
        Independent samples of what it leaves.
    unlisted
        Criterion of what explains the records and is none of them.
    limits_of
        Other names of effects of a set, of which the records show only a limit.
    believed
        Share of the probability that a set keeps, of twins the largest; the rest is that of none of
        them.
    most
        How probable each set can be at most, if nothing else explains the records; empty for 1.
    """
    classes = _classes(carried)
    best = min(unlisted, *(one.criterion for one in carried))
    # a class counts once, however many spellings the library has for it
    weights = np.array([np.exp(-0.5 * (carried[c[0]].criterion - best)) for c in classes])
    none = unexplained_probability(judgement, effective_samples)
    shares = weights / (np.sum(weights) + np.exp(-0.5 * (unlisted - best)))
    most = most or [1.0] * len(carried)
    # what else would have passed is counted once, by the test or by the shapes
    shares = shares * [
        min((1.0 - none) * max(believed(carried[i]) for i in c), max(most[i] for i in c))
        for c in classes
    ]
    none = 1.0 - float(np.sum(shares))
    kinds = {effect.name: effect.kind for effect in model.effects}
    found = []
    for members, share in zip(classes, shares, strict=True):
        spelled = []
        for one in (carried[i] for i in members):
            limits = limits_of(one)
            kinds |= {other: kinds[name] for name, other in limits.items()}
            spelled.append(one.effects)
            if limits:
                spelled.append(tuple(limits.get(name, name) for name in one.effects))
        first = carried[members[0]]
        found.append(
            Explanation(
                first.effects,
                float(share),
                errors[members[0]],
                _parameters(model, first),
                tuple(spelled[1:]),
                first.bench,
            )
        )
    found.sort(key=lambda one: -one.probability)
    return Explanations(
        tuple(found), none, _inclusion(found), _inclusion(found, lambda name: kinds[name])
    )


def unexplained_probability(judgement: Judgement, effective_samples: float) -> float:
    """Return how probable it is that none of the explanations is one.

    A probability p of what is left, were it noise, is evidence of at most −1/(e p ln p) against
    noise   [Sellke, Bayarri & Berger 2001, Am. Stat. 55, 62]. The odds are even where the verdict
    turns: at the level of the test, at the misfit, and at the error of the runs held out that are
    tolerated. So something is always left for what no dictionary holds, some 11 % where nothing
    speaks for it.
    """
    left = judgement.left
    logarithm = np.log(_least_bayes_factor(SIGNIFICANCE))
    # a pattern that the noise given, the linear data's error or arithmetic explains says nothing
    explained = not judgement.structured or not judgement.carries_over
    probability = 1.0 if left.probability is None else left.probability
    if not (explained and probability <= SIGNIFICANCE):
        logarithm -= np.log(_least_bayes_factor(probability))
    if not judgement.structured:
        return _probability(min(logarithm, 0.0))
    tolerated = max(STRUCTURE * left.expected, np.finfo(float).tiny)
    size = effective_samples * np.log(max(left.misfit, tolerated) / tolerated)
    unseen = judgement.unseen * 2.0 * np.log(max(judgement.missed / CARRIED, 1.0))
    return _probability(max(float(logarithm), float(size), float(unseen), 0.0))


def _least_bayes_factor(probability: float) -> float:
    """Return the least factor in favour of noise that a probability can mean."""
    p = float(np.clip(probability, 1e-300, np.exp(-1.0)))
    return float(-np.e * p * np.log(p))


def _probability(log_odds: float) -> float:
    return float(1.0 / (1.0 + np.exp(-np.clip(log_odds, -_CERTAIN, _CERTAIN))))


def _classes(carried: Sequence[Carried]) -> list[list[int]]:
    """Return which explanations predict the fitted records alike, the simplest of each first."""
    classes: list[list[int]] = []
    for i in sorted(range(len(carried)), key=lambda i: carried[i].criterion):
        fit = carried[i].fit
        for members in classes:
            other = carried[members[0]].fit
            apart = float(np.sum((fit.residual - other.residual) ** 2))
            if len(fit.free) == len(other.free) and apart <= _SAME * min(fit.cost, other.cost):
                members.append(i)
                break
        else:
            classes.append([i])
    return classes


def _parameters(model: AugmentedModel, one: Carried) -> Mapping[str, Mapping[str, float]]:
    effects = {effect.name: effect for effect in model.effects}
    return {
        name: {
            p.name: float(one.fit.theta[at])
            for p, at in zip(effects[name].parameters, model.positions(name), strict=True)
        }
        for name in one.effects
    }


def _inclusion(found: Sequence[Explanation], spelled=lambda name: name) -> dict[str, float]:
    """Return the probability of each name in what its effects are spelled as, the largest first.

    Those that are as large as one another are in the order of their names, whatever a set's is.
    """
    total: dict[str, float] = {}
    for one in found:
        for effects in one.members:
            for name in dict.fromkeys(map(spelled, effects)):
                total[name] = total.get(name, 0.0) + one.probability / len(one.members)
    return dict(sorted(total.items(), key=lambda pair: (-pair[1], pair[0])))
