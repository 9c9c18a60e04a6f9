"""Posterior of a comparison: a search's hypotheses and the learners' proposals, in its flows."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from discover.comparison.flows import MEASURED, Flow, FlowBand, Stresses, columns_of
from discover.dataset import Run
from discover.effects import AbstractEffect, ConstitutiveEffect, library_term, named_effects
from discover.equations.parts import combined
from discover.forward import AugmentedModel, make_batch
from discover.forward.of_fluids import bare_run
from discover.inference.bands import Predictions
from discover.inference.fit import Fit
from discover.inference.posterior import posterior_of
from discover.inference.rows import Rows
from discover.learners.results import RecoveredTerm
from discover.loop.expected_errors import weighed_laws
from discover.loop.loop import SearchOutcome, search
from discover.loop.task import Say, Task
from discover.processor import in_one_thread
from discover.study.data import StudyData
from discover.study.declared_model import StudyModel, forward_model
from discover.study.schema import Study
from tensor_library import LawTerm, TermLibrary

_EXPONENTIAL = "(exp(epsilon*tr(sigma))-1)*sigma"
_EFFECTS = {
    "sigma.sigma": ("giesekus_mobility", 1.0),
    "sigma.gammadot+gammadot.sigma": ("non_affine_motion", 2.0),
    "tr(sigma)*sigma": ("ptt_linear", 1.0),
    _EXPONENTIAL: ("ptt_exponential", 1.0),
}
"""Terms that are effects with a name, and the constant of the effect over the coefficient, or over
the inner constant."""

_NEAR = 0.3
"""Distance of a coefficient from one within which the exponential term is exponential PTT."""

MOST_EFFECTS = 3


def search_hypotheses(
    study: Study, data: StudyData, declared: StudyModel, library: TermLibrary, say: Say
) -> SearchOutcome:
    """Return the posterior over what a search adds to the known part.

    Candidates are every named effect, of fluid and instrument, and every library term. What of the
    known part is to be fitted is fitted with every hypothesis. `say`: takes a line of text.
    """
    dataset, fit = data.dataset, list(data.fit.names)
    if study.compare.use_normal_stresses:
        also = [run.observing(quantity) for run in data.fit for quantity in run.also_recorded]
        dataset = replace(dataset, runs=(*dataset.runs, *also))
        fit += [run.name for run in also]
    named = [effect for effect in named_effects().values() if not effect.on_request]
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
    found: SearchOutcome, terms: Mapping[str, Sequence[RecoveredTerm]]
) -> tuple[SearchOutcome, dict[str, Proposed]]:
    """Return the posterior over the search's hypotheses and those of learners, and each of these.

    A learner's terms stand beside the instrument of the likeliest hypothesis.
    """
    search, problem = found.posterior.search.copied(), found.posterior.problem
    alive = search.ranked()
    if not alive:
        return found, {name: Proposed(tuple(some)) for name, some in terms.items()}
    best = alive[0]
    of_fluid = [n for n in best.names if isinstance(problem.effects[n], ConstitutiveEffect)]
    bench = [name for name in best.names if name not in of_fluid]
    keys: dict[str, frozenset[str]] = {}
    starts: dict[frozenset[str], Fit] = {}
    for learner, some in terms.items():
        values = _as_effects(some, problem.effects)
        if values is None:
            continue
        theta = problem.without(best.theta, *of_fluid)
        for name, value in values.items():
            theta[problem.model.positions(name)[0]] = value
        keys[learner] = key = frozenset({*values, *bench})
        if key not in search.found:
            starts.setdefault(key, search.fitter.start(tuple(sorted(key)), theta, best.linear))
    search.add(starts.values())
    if any(np.isfinite(search.found[key].log_evidence) for key in starts):
        found = replace(found, posterior=posterior_of(search, found.posterior))
    shares = {frozenset(fit.names): share for fit, share in found.posterior.fits}
    proposed = {name: Proposed(tuple(some)) for name, some in terms.items()}
    for learner, key in keys.items():
        fit = search.found[key]
        if fit.covariance is not None and np.isfinite(fit.log_posterior):
            own = _refitted(terms[learner], fit, found)
            proposed[learner] = Proposed(own, shares.get(key, 0.0))
    return found, proposed


def _as_effects(
    terms: Sequence[RecoveredTerm], effects: Mapping[str, AbstractEffect]
) -> dict[str, float] | None:
    """Return the constant of each effect that terms are, by name; None where one is no effect."""
    found = {}
    for term in terms:
        name, factor = _EFFECTS.get(term.term, (term.term, 1.0))
        value = factor * term.coefficient
        if term.term == _EXPONENTIAL:
            if abs(term.coefficient - 1.0) > _NEAR:
                return None
            value = term.inner["epsilon"]
        effect = effects.get(name)
        if effect is None or len(effect.parameters) != 1:
            return None
        if not effect.parameters[0].low <= value <= effect.parameters[0].high:
            return None
        found[name] = value
    return found


def _refitted(
    terms: Sequence[RecoveredTerm], fit: Fit, found: SearchOutcome
) -> tuple[RecoveredTerm, ...]:
    """Return terms with the coefficients of a fit and their 95 % intervals."""
    model, out = found.posterior.problem.model, []
    assert fit.covariance is not None
    for term in terms:
        name, factor = _EFFECTS.get(term.term, (term.term, 1.0))
        at = model.positions(name)[0]
        low, high = (end / factor for end in fit.interval(at))
        value = float(fit.theta[at]) / factor
        own: dict[str, Any] = {"coefficient": value, "ci95": (low, high)}
        if term.term == _EXPONENTIAL:
            inner, ends = {"epsilon": value}, {"epsilon": (low, high)}
            own = {"coefficient": 1.0, "inner": inner, "inner_ci95": ends}
        out.append(replace(term, **own))
    return tuple(out)


def terms_of(fit: Fit, found: SearchOutcome) -> tuple[LawTerm, ...] | None:
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
    return {terms.get(effect, effect) for effect in effects}


@in_one_thread
def flow_bands(
    found: SearchOutcome, flows: Sequence[Flow], runs: Mapping[str, Run]
) -> dict[str, FlowBand]:
    """Return the band of each flow, by its key; those in which most hypotheses diverge have none.

    Where no law is all there is, σ12 is that of laws which predict runs left out best, as in a
    closed loop. These need not come nearest in N1 and N2, for which all count that describe the
    runs about as well. Runs are predicted as recorded, other flows for the fluid alone. `runs`: as
    recorded, by name.
    """
    posterior, asked = found.posterior, [flow_run(flow, found, runs) for flow in flows]
    weighed, out = weighed_laws(posterior), {}
    for recorded in (True, False):
        some = [
            (flow, run)
            for flow, run in zip(flows, asked, strict=True)
            if (flow.kind in MEASURED) is recorded
        ]
        if some:
            predictions = Predictions(posterior, Rows.of([run for _, run in some]), recorded)
            of_stress, of_normal = map(predictions.bands, (posterior.best_predictive_laws, weighed))
            for (flow, _), first, others in zip(some, of_stress, of_normal, strict=True):
                if first is not None and others is not None:
                    ends = zip(astuple(first), astuple(others), strict=True)
                    out[flow.key] = FlowBand(
                        *(columns_of(np.c_[a[:, :1], b[:, 1:]]) for a, b in ends)
                    )
    return out


def flow_run(flow: Flow, found: SearchOutcome, runs: Mapping[str, Run]) -> Run:
    """Return the run that a flow asks for; one at hand with its steps placed where they are."""
    run = runs.get(flow.name) if flow.kind in MEASURED else None
    if run is None:
        return run_of(flow)
    placed = [one for one in (*found.task.fitted, *found.task.held_out) if one.name == run.name]
    return replace(run, rate_steps=placed[0].rate_steps) if placed else run


def run_of(flow: Flow) -> Run:
    """Return a flow, with the rate as it was recorded, as a run of which nothing is recorded."""
    return replace(bare_run(flow.protocol, flow.times, flow.name), rate=flow.rate)


def in_flows(
    model: AugmentedModel,
    thetas: Sequence[Float[np.ndarray, " p"]],
    flows: Sequence[Flow],
    runs: Sequence[Run] | None = None,
) -> list[dict[str, Stresses | None]]:
    """Return what vectors of constants predict in each flow, by its key; None where they diverge.

    `runs`: that the flows ask for; by default of the fluid alone.
    """
    if not flows:
        return [{} for _ in thetas]
    runs = list(map(run_of, flows)) if runs is None else runs
    with np.errstate(all="ignore"):
        predicted = model.observables(thetas, make_batch(runs))
    return [
        {
            flow.key: columns_of(rows[: len(flow.times)])
            if np.all(np.isfinite(rows[: len(flow.times), 0]))
            else None
            for flow, rows in zip(flows, of_one, strict=True)
        }
        for of_one in predicted
    ]
