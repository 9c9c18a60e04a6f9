"""Score every effect by how well its signature, beyond what is fitted, explains the residual."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from discover.closed_loop.results.candidate_score import CandidateScore
from discover.effects import AbstractEffect
from discover.forward import AugmentedModel, Batch
from discover.inference.least_squares import Fit

ALIAS_COSINE = 0.99
"""Signatures that agree to this cosine are the same to first order."""

_RUNAWAY = 1e9
"""Weighted residual from which on a trial says nothing but that its stress runs away."""

_STRETCHES = (0.25, 4.0, 16.0, 64.0)
"""Multiples of the amplitude that a signature foretells which are tried beside it."""

TRIED_AT = 4.0
"""Multiple of an effect's first trial at which it shows."""

_INNER_STRETCHES = (0.0, 1.0 / 30.0, 1.0 / 6.0, 5.0)
"""Multiples of an inner time or exponent from which an effect is tried too."""

_NARROW = 100.0
"""Ratio of the ends of a range up to which its first trial is close to every value in it."""


@dataclass
class Attribution:
    """All candidates at one stage: those worth a refit, and the rest."""

    leading: list[CandidateScore]
    rest: list[CandidateScore]


def attribute(
    model: AugmentedModel,
    batch: Batch,
    fit: Fit,
    active: Sequence[str],
    leaders: int,
    admitted: Callable[[AbstractEffect], bool] = lambda effect: True,
) -> Attribution:
    """Return every effect that is not yet in the model, scored and ranked.

    The signature of an effect is the change of the prediction at a small amplitude, made
    orthogonal to what the fitted parameters can do. Because a base law may be far off, where a
    signature at zero amplitude says little, amplitudes around the first-order one are tried with
    the whole nonlinear model as well, once with what is fitted held and once with it giving way to
    first order, and candidates are ranked by the best of them.

    Parameters
    ----------
    model, batch
        The model with all candidates, and the runs fitted.
    fit
        The current fit.
    active
        Effects already in the model.
    leaders
        How many candidates with signatures of their own lead, how many more whose signature one
        of those has already, and, where constants of the declared model are fitted, how many of
        the simplest that seem to do nothing.
    """
    waiting = [e for e in model.effects if e.name not in active and admitted(e)]
    if not waiting:
        return Attribution([], [])
    trials = [(effect, base) for effect in waiting for base in _bases(model, fit, effect)]
    owners, bases = [effect for effect, _ in trials], [base for _, base in trials]
    at = [model.slices[effect.name].start for effect in owners]
    probes = []
    for base, position in zip(bases, at, strict=True):
        theta = base.copy()
        theta[position] += 0.1 * model.first_trial[position]
        probes.append(theta)
    residual = fit.residual.ravel()
    total = float(residual @ residual)
    changes = model.residuals(probes, batch).reshape(len(probes), -1) - residual
    known = fit.jacobian.reshape(len(fit.free), residual.size).T
    basis, upper = np.linalg.qr(np.where(_is_tame(known), known, 0.0))
    tried, sides, yields = [], [], []
    for effect, position, change in zip(owners, at, changes, strict=True):
        signature = np.where(_is_tame(change), change, 0.0) / (0.1 * model.first_trial[position])
        length = np.linalg.norm(signature)
        shared = basis.T @ signature
        beyond = signature - basis @ shared
        beyond_length = np.linalg.norm(beyond)
        score, step = 0.0, 0.0
        if beyond_length > 1e-4 * length and length > 0:
            step = float(-(beyond @ residual) / beyond_length**2)
            score = float((beyond @ residual) ** 2 / beyond_length**2 / total)
            # an amplitude outside its range explains nothing
            if not model.low[position] < step < np.inf:
                score, step = 0.0, 0.0
        tried.append(CandidateScore(effect.name, effect.kind, score, step))
        sides.append(beyond / beyond_length if score > 0 else np.zeros_like(beyond))
        yields.append(-np.linalg.lstsq(upper, shared, rcond=None)[0])
    _try_amplitudes(model, batch, fit, tried, bases, at, yields)
    candidates, signatures = [], []
    for effect in waiting:
        own = [i for i, owner in enumerate(owners) if owner is effect]
        best = max(own, key=lambda i: tried[i].reduction)
        candidates.append(tried[best])
        signatures.append(sides[best])
    order = sorted(
        range(len(waiting)),
        key=lambda i: (-round(candidates[i].reduction, 6), waiting[i].complexity, i),
    )
    heads: list[int] = []
    twins: list[int] = []
    for i in order:
        if candidates[i].reduction <= 0.0:
            continue
        twin = any(abs(signatures[h] @ signatures[i]) > ALIAS_COSINE for h in heads)
        (twins if twin else heads).append(i)
    # signatures that agree at zero may part at the amplitude that is there, so twins are refitted
    # too; but they must not crowd out candidates of another kind
    twins.sort(key=lambda i: (waiting[i].complexity, -candidates[i].reduction))
    leading = heads[:leaders] + twins[:leaders]
    if model.free_positions:
        # constants that were fitted without an effect may stand where every small amount of it is
        # worse: what points the wrong way is refitted from a finite amount
        silent = [i for i in order if candidates[i].reduction <= 0.0]
        silent.sort(key=lambda i: (waiting[i].complexity, i))
        for i in silent[:leaders]:
            position = model.slices[waiting[i].name].start
            start = fit.theta.copy()
            start[position] = np.clip(
                TRIED_AT * model.first_trial[position], model.low[position], model.high[position]
            )
            candidates[i].start = start
            leading.append(i)
    rest = [i for i in order if i not in leading]
    return Attribution([candidates[i] for i in leading], [candidates[i] for i in rest])


def _is_tame(values: np.ndarray) -> np.ndarray:
    """Return where a trial did not run away: its square must be a number too."""
    return np.abs(values) < _RUNAWAY  # false for what is not a number


def _bases(model: AugmentedModel, fit: Fit, effect: AbstractEffect) -> list[np.ndarray]:
    """Return parameter vectors from which an effect is tried: its inner parameters at some sizes.

    At zero amplitude they change nothing, but the signature depends on them, and from a time that
    is far off a fit finds no way.
    """
    return [fit.theta.copy(), *with_other_inner(model, fit.theta, effect)]


def with_other_inner(
    model: AugmentedModel, theta: np.ndarray, effect: AbstractEffect
) -> list[np.ndarray]:
    """Return a parameter vector with the inner parameters of an effect at other sizes, if any."""
    inner = [
        at
        for at in model.positions(effect.name)[1:]
        if model.low[at] <= 0.0 or model.high[at] > _NARROW * model.low[at]
    ]
    out = []
    for stretch in _INNER_STRETCHES if inner else ():
        other = theta.copy()
        other[inner] = np.clip(stretch * theta[inner], model.low[inner], model.high[inner])
        out.append(other)
    return out


def _try_amplitudes(model, batch, fit, candidates, bases, at, yields):
    """Try amplitudes, with what is fitted already held, and giving way to first order.

    First those that the signatures foretell. Of the others each is followed as long as it is
    better than the best of its effect by then.
    """
    for candidate, base in zip(candidates, bases, strict=True):
        candidate.start = base.copy()
    least = {candidate.effect: fit.cost for candidate in candidates}
    for only_foretold in (True, False):
        trials = [
            (candidate, theta)
            for candidate, *about in zip(candidates, bases, at, yields, strict=True)
            if candidate.score > 0
            for theta in _amplitudes(model, fit, candidate.step, only_foretold, *about)
        ]
        if not trials:
            return
        useful = np.array([least[candidate.effect] for candidate, _ in trials])
        with np.errstate(over="ignore", invalid="ignore"):  # a trial that ran away
            residuals = model.residuals([theta for _, theta in trials], batch, useful)
            costs = np.sum(residuals**2, axis=(1, 2))
        for (candidate, theta), cost in zip(trials, costs, strict=True):
            reduction = 1.0 - cost / fit.cost if np.isfinite(cost) else 0.0
            if reduction > candidate.reduction:
                candidate.reduction = float(reduction)
                candidate.start = theta
                least[candidate.effect] = min(least[candidate.effect], float(cost))


def _amplitudes(model, fit, step, only_foretold, base, position, given) -> list[np.ndarray]:
    """Return parameter vectors with an effect at the step foretold, or at other multiples of it."""
    others, found = list(fit.free), []
    low, high = model.low[position], model.high[position]
    foretold, *further = np.clip(np.multiply((1.0, *_STRETCHES), step), low, high)
    # several of them may be cut off at the same bound
    for amplitude in (foretold,) if only_foretold else sorted({*further} - {foretold}):
        theta = base.copy()
        theta[position] = amplitude
        found.append(theta)
        if others:
            moved = theta.copy()
            moved[others] += amplitude * given
            found.append(np.clip(moved, model.low, model.high))
    return found
