"""When rates step that were read in samples, found before any learner looks at the records."""

from collections.abc import Sequence
from dataclasses import replace

import jax.numpy as jnp
import numpy as np

from discover.comparison.fitting.prepared import with_each_run
from discover.dataset import Run
from discover.effects import library_term
from discover.forward import AugmentedModel, Batch, data_scales, make_batch
from discover.inference.least_squares import best_of, fit_batch
from discover.inference.step_instants import with_own_instants, with_places, with_rate_steps
from discover.statistics.residual import summarise
from discover.study.data import StudyData
from discover.study.declared_model import DeclaredModel, forward_model
from discover.words import listed
from tensor_library.library import TermLibrary

_MOST_TERMS = 16
"""Terms of the law that dates the steps, at most: the simplest of the library."""

_FEW = 3
"""Terms of the law that dates steps of runs held out, at most."""

_NAMED = 3

_INSIDE = 1e-3
"""Share of the interval by which an instant keeps off the samples at its ends."""


def with_step_instants(
    declared: DeclaredModel, data: StudyData, library: TermLibrary
) -> tuple[StudyData, str]:
    """Return data whose rates step when their stresses say, and what is said of it.

    The instants are fitted together with every simple term of the library, which no learner
    chooses from: a law too flexible to be believed dates a step well, and both learners are given
    the same instants. It extrapolates badly, so those of runs held out are fitted to these runs
    with the few terms that fit best, as they are. Data without such steps, and data that this law
    cannot be integrated through, stay as they are.
    """
    fitted = [with_rate_steps(run) for run in data.fit.runs]
    unseen = [with_rate_steps(run) for run in data.dataset.runs if run.name not in data.fit.names]
    stepped = [run.name for run in (*fitted, *unseen) if run.rate_steps]
    if not stepped:
        return data, ""
    placed, fitted, unseen = with_places(forward_model(declared), fitted, unseen)
    terms = [library_term(t) for t in library.terms if t.closed_form is None][:_MOST_TERMS]
    model = AugmentedModel(placed, terms, data_scales(fitted))
    free = [*model.free_positions, *(model.positions(term.name)[0] for term in terms)]
    batch = make_batch(fitted)
    fit = fit_batch(model, batch, [model.zero()], [free])[0]
    if not fit.usable:
        return data, ""
    shares = fit.theta[model.instants]
    dated = {run.name: _dated(run, shares) for run in fitted}
    few = _few_terms(model, batch, [model.positions(term.name)[0] for term in terms])
    dated |= {run.name: _dated(run, shares) for run in with_own_instants(model, few, unseen)}
    runs = listed(stepped) if len(stepped) <= _NAMED else f"{len(stepped)} runs"
    told = (
        f"The rate of {runs} steps between two samples, which do not tell when: the instants are "
        "fitted before, with every simple term of the library, and those of a run held out to that "
        "run itself"
    )
    return with_each_run(data, lambda run: dated[run.name]), told


def _few_terms(model: AugmentedModel, batch: Batch, terms: Sequence[int]) -> np.ndarray:
    """Return the parameters of the few terms that fit best, added one at a time."""
    weight = np.asarray(batch.weight)
    best = fit_batch(model, batch, [model.zero()], [model.free_positions])[0]
    effective = summarise(best.residual, weight).effective_samples
    while len(best.free) < len(model.free_positions) + _FEW:
        further = [at for at in terms if at not in best.free]
        starts = [best.theta] * len(further)
        fits = fit_batch(model, batch, starts, [(*best.free, at) for at in further], rivals=True)
        after = best_of(fits) or best
        # Schwarz 1978, Ann. Stat. 6, 461, with the choice among the terms
        price = np.log(effective) + 2.0 * np.log(len(terms))
        if not best.usable or effective * np.log(best.cost / after.cost) <= price:
            break
        best, effective = after, summarise(after.residual, weight).effective_samples
    return best.theta


def _dated(run: Run, shares: np.ndarray) -> Run:
    """Return a run whose rate steps at these shares of the intervals, or at its own."""
    protocol = run.protocol
    knots, rates = np.asarray(protocol.table_times), np.asarray(protocol.table_rates)
    for step in run.rate_steps:
        share = step.share if step.place is None else float(shares[step.place])
        instant = step.at(float(np.clip(share, _INSIDE, 1.0 - _INSIDE)))
        after = int(np.searchsorted(knots, instant))
        levels = rates[after - 1], rates[after]
        knots = np.insert(knots, after, [instant, instant])
        rates = np.insert(rates, after, levels)
    if not run.rate_steps:
        return run
    protocol = replace(protocol, table_times=jnp.asarray(knots), table_rates=jnp.asarray(rates))
    return replace(run, protocol=protocol, rate_steps=())
