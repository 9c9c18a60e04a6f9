"""Declared constants that differ from what was declared, held against the effects that were found.

A spectrum is measured in another test, at a temperature that may differ, on another filling or
another batch; a known effect has the constants of an earlier result or of a data sheet. What either
leaves of the data where it is wrong looks like an effect: of an upper convected Maxwell fluid in
shear, a slip of s = (1/f − 1)/(Gλ) leaves the same stress at all times as a factor f on all times.
A factor on all moduli is `stress_gain`, which is a candidate; these are none, since what to do
about them is to fit the constants along, and to ask again what is missing.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
from jaxtyping import Float

from discover.closed_loop.explanations.beam import Carried
from discover.closed_loop.judging.judgement import Judgement
from discover.closed_loop.search import Search
from discover.effects import AbstractEffect
from discover.forward import AugmentedModel, Batch
from discover.inference.evidence import BARE_MENTION, INDISTINGUISHABLE
from discover.inference.least_squares import Fit
from discover.words import listed, percent_of

FACTOR = "relaxation_time_factor"
"""Among the aliases of an effect, that a factor on all declared times does instead."""

_FACTOR_AT = 1  # of its logarithm, in the parameter vector
_MOST = 4  # sets in which each is tried
_MOST_BESIDE_EFFECT = 16  # a known effect that is wrong puts the right single one far down

Start = tuple[np.ndarray, tuple[int, ...]]


@dataclass(frozen=True)
class Held:
    """Declared constants that no fit may change.

    Attributes
    ----------
    name
        As an alias of effects: `FACTOR`, or the known effect.
    positions
        Of the constants in the parameter vector.
    effect
        The known effect; None for the factor.
    """

    name: str
    positions: tuple[int, ...]
    effect: AbstractEffect | None = None

    def said(self, model: AugmentedModel, theta: np.ndarray) -> str:
        """Return in words what a fit makes of the constants."""
        if self.effect is None:
            factor = np.exp(theta[_FACTOR_AT])
            return f"With relaxation times that are all {factor:.3g} times the declared ones"
        if self.is_gone(model, theta):
            return f"Without {self.name}"
        names = dict(zip(model.positions(self.name), self.effect.parameters, strict=True))
        zero = model.zero()
        values = [f"{names[p].name} = {theta[p]:.3g} {names[p].unit}".rstrip()
                  + f" (declared: {zero[p]:.3g})" for p in self.positions]  # fmt: skip
        return f"With {listed(values)} of {self.name}"

    def is_gone(self, model: AugmentedModel, theta: np.ndarray) -> bool:
        """Return whether a fit does without the known effect: its amplitude is zero."""
        if self.effect is None:
            return False
        return bool(theta[model.positions(self.name)[0]] == 0.0)

    @property
    def advice(self) -> str:
        """What to do about it."""
        if self.effect is None:
            return (
                "A sweep at another temperature or of another sample does that: look at it, or fit "
                'the times along ([model] relaxation_time_s = "fit").'
            )
        return (
            f"Another sample than the one that {self.name} was found on does that: look where it "
            'comes from, leave it out, or fit it along ("fit" in [model] effects).'
        )


@dataclass(frozen=True)
class OtherConstants:
    """Declared constants with other values, beside some effects, that explain the records.

    Attributes
    ----------
    name
        Of what was held; see `Held`.
    effects
        That stay beside it.
    sentence
        What they do, and what to do about it.
    criterion
        As of `Carried`; what was held counts as an effect.
    theta
        All parameters of the fit.
    unseen_error
        Relative misfit of the runs held out; None where there is none.
    """

    name: str
    effects: tuple[str, ...]
    sentence: str
    criterion: float
    theta: Float[np.ndarray, " p"]
    unseen_error: float | None


def other_constants(
    search: Search, carried: Sequence[Carried], judgement: Judgement, unseen: Batch | None
) -> list[OtherConstants]:
    """Return sets of effects that explain the fitted runs beside other declared constants.

    Where the runs are explained, the constants take the place of each effect of each explanation;
    where they are not, they are tried beside nothing, beside what was found, less one effect or
    not, and beside single effects. Where runs held out refute what was found, only those of a known
    effect are tried, and have to miss these runs by less.
    """
    if not (search.active or judgement.structured):
        return []
    found = []
    for held in _held(search, judgement.carries_over):
        tried = _sets(search, carried, judgement, held)
        starts = [theta for theta, _ in tried.values()]
        free = [(*own, *held.positions) for _, own in tried.values()]
        for names, fit in zip(tried, search.problem.fits(starts, free, rivals=True), strict=True):
            possible = np.isfinite(fit.cost) and _inside(search.model, fit, held)
            if possible and search.tolerated.explained(fit, names) and fit.usable:
                found.append(_found(search, held, names, fit, unseen))
    # beside effects that do as well alone the constants do nothing
    alone = {one.effects: _worth(search, one.cost, one.free, one.effects) for one in search.seen}
    found = [one for one in found if one.criterion < alone.get(one.effects, np.inf) - BARE_MENTION]
    if judgement.carries_over or unseen is None:
        return found
    refuted = _error(search.model, search.fit.theta, unseen)
    return [one for one in found if one.unseen_error is not None and one.unseen_error < refuted]


def _held(search: Search, carries_over: bool) -> list[Held]:
    """Return the declared constants that the search held: times, and those of known effects."""
    free, model = search.fit.free, search.model
    times = carries_over and _FACTOR_AT not in free  # a fit says nothing of what else is refuted
    held = [Held(FACTOR, (_FACTOR_AT,))] if times else []
    for known in model.declared.effects:
        if own := tuple(p for p in model.positions(known.name) if p not in free):
            held.append(Held(known.name, own, known.effect))
    return held


def _sets(
    search: Search, carried: Sequence[Carried], judgement: Judgement, held: Held
) -> dict[tuple[str, ...], Start]:
    tried: dict[tuple[str, ...], Start] = {}
    for one in carried[:_MOST]:
        for name in one.effects:
            left = tuple(sorted(set(one.effects) - {name}))
            tried.setdefault(left, search.problem.without(one.fit, name))
    if judgement.structured:
        tried.setdefault((), search.problem.without(search.fit, *search.active))
        tried.setdefault(tuple(sorted(search.active)), (search.fit.theta, search.fit.free))
        single = sorted((s for s in search.seen if len(s.effects) == 1), key=lambda s: s.cost)
        for seen in islice(single, _MOST if held.effect is None else _MOST_BESIDE_EFFECT):
            tried.setdefault(seen.effects, (seen.theta(search.model), seen.free))
    return tried


def _inside(model: AugmentedModel, fit: Fit, held: Held) -> bool:
    """Return whether no constant is at an end of what it can be, or the effect is gone."""
    at = list(held.positions)
    inside = (model.low[at] < fit.theta[at]) & (fit.theta[at] < model.high[at])
    return held.is_gone(model, fit.theta) or bool(np.all(inside))


def _found(
    search: Search, held: Held, effects: tuple[str, ...], fit: Fit, unseen: Batch | None
) -> OtherConstants:
    worth = _worth(search, search.problem.cost(fit), fit.free, (*effects, held.name))
    missed = f"the fitted runs are missed by {percent_of(float(np.mean(fit.run_errors)))}"
    error = None if unseen is None else _error(search.model, fit.theta, unseen)
    if error is not None:
        missed += f", and those held out by {percent_of(error)}"
    along = " and with " if held.is_gone(search.model, fit.theta) else " and "
    beside = along + " and ".join(effects) if effects else ""
    sentence = f"{held.said(search.model, fit.theta)}{beside} {missed}. {held.advice}"
    return OtherConstants(held.name, effects, sentence, worth, fit.theta, error)


def _error(model: AugmentedModel, theta: np.ndarray, runs: Batch) -> float:
    """Return the relative misfit of runs, mean over them."""
    residual = np.asarray(model.residuals([theta], runs))[0]
    return float(np.mean(np.sqrt(np.sum(residual**2, axis=1))))


def _worth(search: Search, cost: float, free: Sequence[int], effects: Sequence[str]) -> float:
    """Return the criterion of a fit as the explanations are weighed: by what the search left."""
    problem = search.problem
    return problem.criterion(cost, free, effects, problem.independent_samples(search.fit))


def weighed_constants(
    others: Sequence[OtherConstants], carried: Sequence[Carried], active: Sequence[str]
) -> list[tuple[OtherConstants, float]]:
    """Return sets beside other constants, and how much likelier each is than what was found.

    Those that the records tell from it are left out.
    """
    own = next((one.criterion for one in carried if set(one.effects) == set(active)), np.inf)
    return [
        (one, float(np.exp(0.5 * (own - one.criterion))))
        for one in others
        if abs(one.criterion - own) < INDISTINGUISHABLE
    ]


def compared_with_constants(
    judgement: Judgement,
    active: Sequence[str],
    carried: Sequence[Carried],
    others: Sequence[OtherConstants],
) -> tuple[Judgement, dict[str, str]]:
    """Return the judgement, and what constants do as well instead of effects that were found.

    Where other constants explain the runs clearly better than what was found, that is no finding.
    """
    if not others:
        return judgement, {}
    best = min(others, key=lambda one: one.criterion)
    own = next(one.criterion for one in carried if set(one.effects) == set(active))
    if judgement.structured or best.criterion < own - INDISTINGUISHABLE:
        return _with_sentence(replace(judgement, structured=True, verdict="unexplained"), best), {}
    # the best last, which stays
    instead = {
        name: one
        for one in sorted(others, key=lambda one: -one.criterion)
        for name in active
        if name not in one.effects and one.criterion < own + INDISTINGUISHABLE
    }
    if instead:
        judgement = _with_sentence(judgement, min(instead.values(), key=lambda one: one.criterion))
    return judgement, {name: one.name for name, one in instead.items()}


def _with_sentence(judgement: Judgement, other: OtherConstants) -> Judgement:
    return replace(judgement, description=f"{judgement.description} {other.sentence}")
