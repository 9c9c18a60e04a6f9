"""Posterior of a comparison: a search's hypotheses and the learners' proposals, weighed."""

import queue
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from threading import Event
from typing import TypeVar

import numpy as np

from discover.effects import AbstractEffect, ConstitutiveEffect, library_term, named_effects
from discover.equations.parts import combined
from discover.inference.engine.fit import Fit
from discover.inference.engine.posterior import posterior_of
from discover.learners.results import RecoveredTerm
from discover.loop.loop import Found, search
from discover.loop.task import Say, Task
from discover.progress import Progress, Stopped, may_be_stopped
from discover.study.data import StudyData
from discover.study.declared_model import StudyModel, forward_model
from discover.study.schema import Study
from tensor_library import LawTerm, TermLibrary

_EFFECTS = {
    "sigma.sigma": ("giesekus_mobility", 1.0),
    "sigma.gammadot+gammadot.sigma": ("non_affine_motion", 2.0),
    "tr(sigma)*sigma": ("ptt_linear", 1.0),
}
"""Terms that are effects with a name, and the constant of the effect over the coefficient."""

_EXPONENTIAL = "(exp(epsilon*tr(sigma))-1)*sigma"
_NEAR = 0.3
"""Distance of a coefficient from one within which the exponential term is exponential PTT."""

MOST_EFFECTS = 3


def search_hypotheses(
    study: Study, data: StudyData, declared: StudyModel, library: TermLibrary, say: Say
) -> Found:
    """Return the posterior over what a search adds to the known part.

    Candidates are every named effect, of fluid and instrument, and every library term. What of the
    known part is to be fitted is fitted with every hypothesis. `say`: takes a line of text.
    """
    dataset = data.dataset
    runs = {run.name: run for run in dataset.runs}
    fit = list(data.fit.names)
    if study.compare.use_normal_stresses:
        for name in data.fit.names:
            for quantity in runs[name].beside:
                also = runs[name].observing(quantity)
                dataset = replace(dataset, runs=(*dataset.runs, also))
                fit.append(also.name)
    known = {effect.name for effect in declared.effects}
    named = [e for e in named_effects().values() if not e.on_request and e.name not in known]
    terms = [
        library_term(term)
        for term in library.terms
        if term.closed_form is None and term.name not in _EFFECTS
    ]
    task = Task.of_runs(
        dataset, forward_model(declared), fit, list(data.held_out.names), [*named, *terms],
        MOST_EFFECTS, noise=study.loop.noise, most_samples=study.compare.most_samples, progress=say,
        loading=study.compare.loading, computed=study.data.synthetic is not None,
    )  # fmt: skip
    return search(task)


@dataclass(frozen=True)
class Proposed:
    """Proposal of a learner, as a hypothesis fitted with all that is free.

    `terms`: with coefficients and intervals of that fit, or as the learner had them. `share`:
    posterior probability among all fitted, were one of them all there is; zero where not fitted.
    """

    terms: tuple[RecoveredTerm, ...]
    share: float = 0.0


def with_proposals(
    found: Found, terms: Mapping[str, Sequence[RecoveredTerm]]
) -> tuple[Found, dict[str, Proposed]]:
    """Return the posterior over the search's hypotheses and those of learners, and each of these.

    A learner's terms stand beside the instrument of the likeliest hypothesis.
    """
    search, problem = found.posterior.search.copied(), found.posterior.problem
    alive = search.alive()
    if not alive:
        return found, {name: Proposed(tuple(some)) for name, some in terms.items()}
    best = alive[0]
    of_fluid = [n for n in best.names if isinstance(problem.effects[n], ConstitutiveEffect)]
    bench = [name for name in best.names if name not in of_fluid]
    keys, starts = {}, []
    for learner, some in terms.items():
        values = _as_effects(some, problem.effects)
        if values is None:
            continue
        theta = problem.without(best.theta, *of_fluid)
        for name, value in values.items():
            theta[problem.model.positions(name)] = value
        names = tuple(sorted({*values, *bench}))
        keys[learner] = frozenset(names)
        if keys[learner] not in search.found and keys[learner] not in {
            frozenset(start.names) for start in starts
        }:
            starts.append(search.fitter.start(names, theta, best.linear))
    search.add(starts)
    if any(np.isfinite(search.found[frozenset(s.names)].log_evidence) for s in starts):
        found = replace(found, posterior=posterior_of(search, found.posterior))
    shares = {frozenset(fit.names): share for fit, share in found.posterior.fits}
    proposed = {}
    for learner, some in terms.items():
        fit = search.found.get(keys[learner]) if learner in keys else None
        if fit is None or fit.covariance is None or not np.isfinite(fit.log_posterior):
            proposed[learner] = Proposed(tuple(some))
            continue
        share = shares.get(keys[learner], 0.0)
        proposed[learner] = Proposed(_refitted(some, fit, found), share)
    return found, proposed


def _as_effects(
    terms: Sequence[RecoveredTerm], effects: Mapping[str, AbstractEffect]
) -> dict[str, list[float]] | None:
    """Return constants of the effects that terms are, by name; None where one is no effect."""
    found = {}
    for term in terms:
        name, factor = _EFFECTS.get(term.term, (term.term, 1.0))
        values = [factor * term.coefficient]
        if term.term == _EXPONENTIAL:
            if abs(term.coefficient - 1.0) > _NEAR:
                return None
            name, values = "ptt_exponential", [term.inner["epsilon"]]
        effect = effects.get(name)
        if effect is None or len(effect.parameters) != len(values):
            return None
        pairs = zip(effect.parameters, values, strict=True)
        if any(not p.low <= value <= p.high for p, value in pairs):
            return None
        found[name] = values
    return found


def _refitted(terms: Sequence[RecoveredTerm], fit: Fit, found: Found) -> tuple[RecoveredTerm, ...]:
    """Return terms with the coefficients of a fit and their 95 % intervals."""
    model, out = found.posterior.problem.model, []
    assert fit.covariance is not None
    for term in terms:
        name, factor = _EFFECTS.get(term.term, (term.term, 1.0))
        name = "ptt_exponential" if term.term == _EXPONENTIAL else name
        at = model.positions(name)[0]
        low, high = (end / factor for end in fit.interval(at))
        value = float(fit.theta[at]) / factor
        if term.term == _EXPONENTIAL:
            inner = {"epsilon": value}
            out.append(
                replace(term, coefficient=1.0, inner=inner, inner_ci95={"epsilon": (low, high)})
            )
        else:
            out.append(replace(term, coefficient=value, ci95=(low, high)))
    return tuple(out)


def terms_of(fit: Fit, found: Found) -> tuple[LawTerm, ...] | None:
    """Return what a hypothesis adds to the law as library terms; None if it is no such sum.

    Of two effects with a term in common the coefficients are added up.
    """
    problem, terms = found.posterior.problem, []
    for name in fit.names:
        effect = problem.effects[name]
        if not isinstance(effect, ConstitutiveEffect):
            continue
        added = effect.as_terms([float(v) for v in fit.theta[problem.model.positions(name)]])
        if added is None:
            return None
        terms += added
    terms = combined(tuple(terms))
    # a sum has one inner constant of a name
    return terms if len({term.term for term in terms}) == len(terms) else None


def terms_named(effects: Iterable[str]) -> set[str]:
    """Return the names of the terms that effects are; an effect that is no term has its own."""
    terms = {effect: term for term, (effect, _) in _EFFECTS.items()}
    terms["ptt_exponential"] = _EXPONENTIAL
    return {terms.get(effect, effect) for effect in effects}


R = TypeVar("R")

_LOOK_UP = 0.5  # seconds, for an interrupt on systems where a wait cannot be interrupted


def at_once(parts: Mapping[str, Callable[[Progress], R]], progress: Progress) -> dict[str, R]:
    """Return what each part returns, all computed side by side.

    Progress is passed on in the thread of the caller, with the mean of the fractions. If one part
    fails, or the caller is interrupted, the others end where they next ask or say something.
    """
    if len(parts) < 2:
        return {
            name: part(lambda text, fraction, name=name: progress(f"{name}: {text}", fraction))
            for name, part in parts.items()
        }
    told: queue.SimpleQueue[tuple[str, str, float] | Future[R]] = queue.SimpleQueue()
    stop, fractions = Event(), dict.fromkeys(parts, 0.0)

    def run(name: str, part: Callable[[Progress], R]) -> R:
        def say(text: str, fraction: float) -> None:
            if stop.is_set():
                raise Stopped
            told.put((name, text, fraction))

        with may_be_stopped(stop):
            return part(say)

    with ThreadPoolExecutor(len(parts)) as pool:
        try:
            futures = {name: pool.submit(run, name, part) for name, part in parts.items()}
            for future in futures.values():
                future.add_done_callback(told.put)
            running = len(futures)
            while running:
                try:
                    one = told.get(timeout=_LOOK_UP)
                except queue.Empty:
                    continue
                if isinstance(one, Future):
                    one.result()  # or what it failed with
                    running -= 1
                    continue
                name, text, fraction = one
                fractions[name] = max(fractions[name], fraction)
                progress(f"{name}: {text}", sum(fractions.values()) / len(fractions))
        except BaseException:
            stop.set()
            raise
    return {name: future.result() for name, future in futures.items()}
