"""What a law may owe to a rate that is known at the samples only."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from discover.comparison.outcomes.flows import Flow, Stresses, predict
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.dataset.records.rates import (
    CoarseRates,
    coarse_in,
    samples_a_cycle,
    worth_a_look,
)
from discover.identify.side_by_side.many_laws import Contender, fluid_of, predict_laws
from discover.laws.multimode import Fluid
from discover.learners.results.recovered_term import RecoveredTerm
from discover.protocols import another_between_samples, unknown_between_samples
from discover.statistics.projection import rms
from tensor_library.law_terms import LawTerms

LARGEST = 5e-3
"""A larger relative misfit is not put down to arithmetic, as in the closed loop: a rate read 24
times a cycle errs by this."""

_STEP = 1e-3
"""Relative step of a coefficient, and least step, for what it changes."""

KEY = "sampled_rate"
"""Under which it stands among the details of an outcome."""


def with_sampled_rates(
    outcome: LearnerOutcome, fluid: Fluid, declared: Fluid, flows: Sequence[Flow]
) -> LearnerOutcome:
    """Return an outcome whose intervals, and what its misfit may be, allow for rates in samples.

    What another curve through the samples changes in σ12 is told under `KEY` of its details;
    coefficients with an interval get it wider by what that would do to them.
    """
    training = [flow for flow in flows if flow.kind == "training" and flow.measured is not None]
    if not training or any(not np.any(flow.measured) for flow in training):
        return outcome
    found = [outcome.predictions[flow.key] for flow in training]
    own = [one for one in found if one is not None]
    if len(own) < len(training):
        return outcome
    left = _mean_relative([_off(p, f) for p, f in zip(own, training, strict=True)], training)
    unknown = [unknown_between_samples(flow.protocol, flow.times) for flow in training]
    if not worth_a_look(unknown, left):
        return outcome
    pairs = zip(training, own, strict=True)
    changes = [_changed(fluid, flow, prediction) for flow, prediction in pairs]
    change = _mean_relative(changes, training)
    terms, shifts = outcome.terms, {}
    if any(term.ci95 is not None for term in terms):
        terms, shifts, changes = _taken_up(terms, declared, training, changes)
    sizes = [_relative(one, flow) for one, flow in zip(changes, training, strict=True)]
    runs = {
        flow.name: samples_a_cycle(flow.times, flow.rate)
        for flow, size in zip(training, sizes, strict=True)
        if size > 0.5 * max(sizes)
    }
    coarse = CoarseRates(_mean_relative(changes, training), left, shifts, runs)
    return replace(
        outcome,
        terms=terms,
        resolution=change if left <= LARGEST else 0.0,
        details={**outcome.details, KEY: coarse.to_json()},
    )


def coarse_rates_of(outcome: LearnerOutcome) -> CoarseRates | None:
    """Return what rates read in too few samples leave open of a law; None where that is small."""
    return coarse_in(outcome.details.get(KEY))


def _changed(fluid: Fluid, flow: Flow, prediction: Stresses) -> np.ndarray:
    """Return what another rate changes in σ12; zero where it was commanded, or runs away."""
    other = another_between_samples(flow.protocol, flow.times)
    found = None if other is None else predict(fluid, replace(flow, protocol=other))
    if found is None or not np.all(np.isfinite(found["sigma12"])):
        return np.zeros(len(flow.times))
    return found["sigma12"] - prediction["sigma12"]


def _taken_up(
    terms: Sequence[RecoveredTerm],
    declared: Fluid,
    flows: Sequence[Flow],
    changes: Sequence[np.ndarray],
) -> tuple[tuple[RecoveredTerm, ...], Mapping[str, float], list[np.ndarray]]:
    """Return terms with wider intervals, shifts over half-widths, and what is left of changes."""
    law = LawTerms.of(terms)
    values = law.coefficients
    steps = {name: max(abs(value), 1.0) * _STEP for name, value in values.items()}
    laws = [Contender("found", law)]
    laws += [Contender(n, LawTerms({**values, n: values[n] + steps[n]}, law.inner)) for n in values]
    protocols, times = [flow.protocol for flow in flows], [flow.times for flow in flows]
    predicted = predict_laws(fluid_of(laws, declared), protocols, times)[..., 0]
    scale = np.concatenate([np.full(len(f.times), 1.0 / _size(f)) for f in flows])
    rows = [
        np.concatenate([one[i, : len(flow.times)] for i, flow in enumerate(flows)])
        for one in predicted
    ]
    design = np.stack([(row - rows[0]) / steps[n] for n, row in zip(values, rows[1:], strict=True)])
    kept = np.concatenate(changes)
    if not np.all(np.isfinite(design)):
        return tuple(terms), {}, list(changes)
    moved = np.linalg.lstsq((design * scale).T, -kept * scale, rcond=None)[0]
    kept = kept + moved @ design
    wider, shifts = [], {}
    for term, shift in zip(terms, np.abs(moved), strict=True):
        if term.ci95 is None:
            wider.append(term)
            continue
        below, above = term.coefficient - term.ci95[0], term.ci95[1] - term.coefficient
        shifts[term.term] = float(shift / max(0.5 * (below + above), np.finfo(float).tiny))
        limits = (
            term.coefficient - float(np.hypot(below, shift)),
            term.coefficient + float(np.hypot(above, shift)),
        )
        wider.append(replace(term, ci95=limits))
    ends = np.cumsum([len(flow.times) for flow in flows])[:-1]
    return tuple(wider), shifts, np.split(kept, ends)


def _off(prediction: Stresses, flow: Flow) -> np.ndarray:
    return prediction["sigma12"] - flow.measured


def _size(flow: Flow) -> float:
    return rms(np.asarray(flow.measured))


def _relative(difference: np.ndarray, flow: Flow) -> float:
    return rms(difference) / _size(flow)


def _mean_relative(differences: Sequence[np.ndarray], flows: Sequence[Flow]) -> float:
    each = [_relative(one, flow) for one, flow in zip(differences, flows, strict=True)]
    return float(np.mean(each))
