"""Refit the leading candidates and choose the one that earns its place, or none."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from discover.closed_loop.search.scoring.attribution import (
    TRIED_AT,
    CandidateScore,
    with_other_inner,
)
from discover.closed_loop.search.scoring.left_out import (
    FEWEST_FOLDS,
    left_out_parts,
    part_errors,
    run_errors,
)
from discover.effects import AbstractEffect
from discover.forward import AugmentedModel
from discover.inference.evidence import BARE_MENTION, INDISTINGUISHABLE
from discover.inference.fit_uncertainty import intervals
from discover.inference.least_squares import Fit, best_of
from discover.inference.problem import FitProblem

IMPROVEMENT = 0.98
"""An effect must lower the error of the runs left out at least to this fraction."""

RANKING = 1e-3
"""A refit that ranks ends when a step lowers its cost by less than this fraction, which moves no
criterion by one."""

FEWEST_SAMPLES = 5
"""Samples beyond the constants to be fitted, below which any law fits."""

_RESTARTED = 3
_FAR = 10.0
"""Ratio to its first trial from which an inner time or exponent counts as far off."""


_INSIDE = 0.25
"""Share of the largest amplitude from which one that stands there is tried again."""


@dataclass
class Choice:
    """A candidate after its refit.

    Attributes
    ----------
    left_out
        Error of each fitted run when left out.
    parts
        Errors of the parts that are left out together, when they are fitted and when they are not,
        shape (2, parts).
    """

    candidate: CandidateScore
    fit: Fit
    left_out: Float[np.ndarray, " runs"]
    parts: Float[np.ndarray, "2 parts"]


def refit(problem: FitProblem, fit: Fit, leaders: Sequence[CandidateScore]) -> list[Choice]:
    """Refit each leading candidate together with all that is fitted already.

    The refit carries no penalty, so its coefficients are not biased towards zero; it is as sharp as
    a ranking needs (`RANKING`). Fills in the candidates' errors and evidence.
    """
    if not leaders:
        return []
    weight = problem.weight
    free = [(*fit.free, *problem.model.positions(candidate.effect)) for candidate in leaders]
    starts = [candidate.start for candidate in leaders]
    fits = _restarted(problem, problem.fits(starts, free, tolerance=RANKING, rivals=True))
    best = best_of(fits) or fit
    effective = problem.independent_samples(best)
    choices = []
    samples = np.count_nonzero(weight)
    for candidate, trial in zip(leaders, fits, strict=True):
        if not trial.usable or samples < len(trial.free) + FEWEST_SAMPLES:
            continue
        parts = left_out_parts(problem, trial)
        left_out = run_errors(parts, weight)
        errors = [
            part_errors([(held, trial.residual**2) for held, _ in parts], weight),
            part_errors(parts, weight),
        ]
        candidate.error = float(np.mean(trial.run_errors))
        candidate.left_out_error = float(np.mean(left_out))
        candidate.evidence = problem.evidence(fit, trial, effective)
        choices.append(Choice(candidate, trial, left_out, np.array(errors)))
    return choices


def _restarted(problem: FitProblem, fits: Sequence[Fit]) -> list[Fit]:
    """Return fits of which the best were also started from other inner times and exponents.

    In these a misfit has several minima: where two effects share a misfit, the inner time at which
    the first stood alone may be far from the one at which both serve best. An amplitude that
    stands at the end of its range, the best or not, is started from inside it too: a first step
    beyond a minimum may end in another one there, and what is at an end is never a finding.
    """
    model, fits = problem.model, list(fits)
    finite = (i for i, fit in enumerate(fits) if np.isfinite(fit.cost))
    order = sorted(finite, key=lambda i: fits[i].cost)
    starts, owners = [], []
    for i in order[:_RESTARTED]:
        for effect in model.effects:
            if model.positions(effect.name)[0] in fits[i].free:
                others = with_other_inner(model, fits[i].theta, effect)
                starts += others
                owners += [i] * len(others)
    for i in order:
        inside = _from_inside(model, fits[i])
        for effect in model.effects:
            if model.positions(effect.name)[0] in fits[i].free:
                inside += _from_first_trial(model, fits[i].theta, effect)
        starts += inside
        owners += [i] * len(inside)
    if not starts:
        return fits
    free = [fits[i].free for i in owners]
    known = fits[order[0]].cost
    again = problem.fits(starts, free, tolerance=RANKING, rivals=True, known=known)
    for i, fit in zip(owners, again, strict=True):
        if fit.cost < fits[i].cost and fit.usable:
            fits[i] = fit
    return fits


def _from_first_trial(
    model: AugmentedModel, theta: np.ndarray, effect: AbstractEffect
) -> list[np.ndarray]:
    """Return parameters with an effect as it is first tried, if its inner ones are far from there.

    A structure that breaks a hundred times as much and heals a hundred times as fast thins alike in
    steady flow, and from there no step leads to the slow one.
    """
    amplitude, *inner = model.positions(effect.name)
    first = model.zero()
    ratio = [theta[at] / first[at] for at in inner if first[at] > 0.0 and theta[at] > 0.0]
    if not any(max(r, 1.0 / r) > _FAR for r in ratio):
        return []
    other = theta.copy()
    other[inner] = first[inner]
    start = TRIED_AT * model.first_trial[amplitude]
    other[amplitude] = np.clip(start, model.low[amplitude], model.high[amplitude])
    return [other]


def _from_inside(model: AugmentedModel, fit: Fit) -> list[np.ndarray]:
    """Return a fit's parameters with each amplitude at the end of its range put inside."""
    amplitudes = [model.positions(effect.name)[0] for effect in model.effects]
    starts = []
    for at in amplitudes:
        if at in fit.free and np.isfinite(model.high[at]) and fit.theta[at] == model.high[at]:
            theta = fit.theta.copy()
            theta[at] = _INSIDE * model.high[at]
            starts.append(theta)
    return starts


def simplest(choices: Sequence[Choice], model: AugmentedModel) -> Choice:
    """Return the choice with the strongest evidence, or a simpler one about as strong."""
    strongest = max(choice.candidate.evidence or 0.0 for choice in choices)
    complexity = {effect.name: effect.complexity for effect in model.effects}
    # of records that are met exactly, as of three numbers written by hand, evidence is infinite
    near = [c for c in choices if (c.candidate.evidence or 0.0) >= strongest - BARE_MENTION]
    return min(near, key=lambda c: (complexity[c.candidate.effect], -(c.candidate.evidence or 0.0)))


def choose(
    model: AugmentedModel, choices: Sequence[Choice], left_out_before: float
) -> Choice | None:
    """Return the choice with the strongest evidence that also predicts runs left out better."""
    earned = [
        choice
        for choice in choices
        if (choice.candidate.evidence or 0.0) > BARE_MENTION
        and np.mean(choice.left_out) < IMPROVEMENT * left_out_before
    ]
    if not earned:
        return None
    best = simplest(earned, model)
    # what failed to earn a place by a hair is an alias as well as what earned it
    best.candidate.aliases = aliases_of(best, choices)
    return best


def aliases_of(best: Choice, choices: Sequence[Choice]) -> tuple[str, ...]:
    """Return the effects that these data cannot tell from the one chosen.

    There is evidence for them, and either it differs by less than `INDISTINGUISHABLE`, or they are
    near in what they fit and in what they predict of parts left out: the mean excess over the parts
    is no larger than its standard error, the rule of one standard error   [Breiman et al. 1984,
    Classification and Regression Trees, ch. 3] for errors that are paired. Evidence alone would
    not do: it takes what is left for noise, and where neither effect explains the data it is not.
    """
    return tuple(
        choice.candidate.effect
        for choice in choices
        if choice is not best
        and (choice.candidate.evidence or 0.0) > 0.0
        and (
            abs((best.candidate.evidence or 0.0) - (choice.candidate.evidence or 0.0))
            < INDISTINGUISHABLE
            or _near(best, choice)
        )
    )


def _near(best: Choice, other: Choice) -> bool:
    excess = other.parts - best.parts
    count = excess.shape[1]
    if count < FEWEST_FOLDS:
        return False
    error = np.std(excess, axis=1, ddof=1) / np.sqrt(count)
    return bool(np.all(np.mean(excess, axis=1) <= error))


def prune(
    problem: FitProblem, fit: Fit, active: Sequence[str], established: Sequence[str]
) -> tuple[Fit, list[str]]:
    """Drop effects that later ones have made redundant, one after another.

    Parameters
    ----------
    problem, fit
        What is fitted to what, and the current fit.
    active
        Effects in the model, in the order they were added; the last is never dropped.
    established
        Effects that other data showed, which stay.

    Returns
    -------
    The fit and the effects that stay.
    """

    def optional(fit: Fit, active: list[str]) -> list[str]:
        return [name for name in active[:-1] if name not in established]

    return _drop(problem, fit, active, optional, 0.0)


def drop_undecided(
    problem: FitProblem, fit: Fit, active: Sequence[str], established: Sequence[str]
) -> tuple[Fit, list[str]]:
    """Drop effects whose amplitude may be zero, one after another, the weakest first.

    That is, zero lies in its 95 % interval, and the evidence of a fit with it over one without is
    not strong (`INDISTINGUISHABLE`): where it is strong, something is missing without the effect,
    and the interval, which is linear in the parameters, only shows how badly its size is known.

    Parameters
    ----------
    problem, fit, active, established
        As in `prune`, but that the last effect may be dropped too.

    Returns
    -------
    The fit and the effects that stay.
    """

    def optional(fit: Fit, active: list[str]) -> list[str]:
        bounds = intervals(problem.model, problem.batch, fit)
        amplitudes = {name: bounds[problem.model.positions(name)[0]] for name in active}
        return [
            name
            for name, (low, high) in amplitudes.items()
            if low <= 0.0 <= high and name not in established
        ]

    return _drop(problem, fit, active, optional, INDISTINGUISHABLE)


def _drop(
    problem: FitProblem,
    fit: Fit,
    active: Sequence[str],
    optional: Callable[[Fit, list[str]], list[str]],
    enough: float,
) -> tuple[Fit, list[str]]:
    """Drop the weakest of the optional effects until the evidence for it is enough to stay."""
    active = list(active)
    while names := optional(fit, active):
        support, name, without = _weakest(problem, fit, names)
        if support > enough:
            break
        fit = without
        active.remove(name)
    return fit, active


def _weakest(problem: FitProblem, fit: Fit, optional: Sequence[str]) -> tuple[float, str, Fit]:
    """Return the least evidence for one of several effects, its name, and the fit without it."""
    starts, free = zip(*(problem.without(fit, name) for name in optional), strict=True)
    fits = problem.fits(starts, free)
    effective = problem.independent_samples(fit)
    support = [
        problem.evidence(trial, fit, effective) if trial.usable else np.inf for trial in fits
    ]
    weakest = int(np.argmin(support))
    return float(support[weakest]), optional[weakest], fits[weakest]
