"""Learners on runs that are weighed by their own noise, where equal weights will not do."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from discover.comparison.fitting.prepared import with_each_run
from discover.comparison.instrument.known import Known
from discover.comparison.judging.explanation import what_it_leaves
from discover.comparison.learning import Learning
from discover.comparison.outcomes.expected import expectation_of
from discover.comparison.outcomes.flows import QUANTITIES, Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.comparison.own_loadings import loadings_of
from discover.dataset.records.repeats import repeats_among
from discover.dataset.run import Run
from discover.dataset.run_table import kind_of_record
from discover.forward import OBSERVED
from discover.progress import Progress
from discover.statistics.noise_weights import weights_by_noise
from discover.statistics.projection import rms
from discover.study.data import StudyData
from discover.study.schema import Study

Learnt = tuple[Known, Mapping[str, LearnerOutcome]]

_BY_ITS_LAW = "tensor_sindy"
"""The learner by whose law the noise of the runs is told."""


def learned_by_noise(
    study: Study,
    learning: Learning,
    data: StudyData,
    learnt: Learnt,
    known_in: Callable[[StudyData], Known],
    progress: Progress,
) -> Learnt:
    """Return the known part and what learners find in runs weighed by their noise.

    That is so if sparse regression then explains the runs, by no other terms; else what was found
    with equal weights.

    Parameters
    ----------
    study, learning
        What is asked of which learners.
    data
        The data, with equal weights.
    learnt
        The known part in them, and what each learner found.
    known_in
        Returns the known part in other data.
    progress
        Called with what is going on and the fraction done.
    """
    own = learnt[1]
    if _BY_ITS_LAW not in own:
        return learnt

    def seen_in(some: StudyData, learnt: Learnt) -> tuple[_Seen, StudyData]:
        known, own = learnt
        if study.compare.loading is not None:  # what a loading owes its factor is no noise
            some = loadings_of(known, own, study.compare.loading).taken_out(some)
            known = known_in(some)
        return _seen(study, known, own), some

    seen, shown = seen_in(data, learnt)
    weights = _weights(seen, shown.fit.runs, study.compare.use_normal_stresses)
    if weights is None:
        return learnt
    progress("records differ in noise: once more, each weighed by its own", 1.0)
    weighed = with_each_run(data, lambda run: _weighed(run, weights))
    there = known_in(weighed)
    again = replace(learning, prefix="by_noise_").outcomes(list(own), there, progress)
    before, after = ({t.term for t in of[_BY_ITS_LAW].terms} for of in (own, again))
    if after <= before and seen_in(weighed, (there, again))[0].explained:
        return there, again
    return learnt


@dataclass(frozen=True)
class _Seen:
    """The fitted runs, the law of sparse regression in them, and whether it leaves noise."""

    flows: Sequence[Flow]
    outcome: LearnerOutcome
    explained: bool
    random: bool


def _seen(study: Study, known: Known, own: Mapping[str, LearnerOutcome]) -> _Seen:
    repeats = repeats_among(list(known.before.data.dataset))
    expectation = expectation_of(study, known.before.model, repeats)
    flows = [flow for flow in known.flows if flow.kind == "training"]
    outcome = known.frame(own[_BY_ITS_LAW]).outcome(own[_BY_ITS_LAW])
    left = what_it_leaves(outcome, flows, expectation, study.compare.use_normal_stresses)
    return _Seen(flows, outcome, left.verdict == "explained", left.random)


def _weights(seen: _Seen, runs: Sequence[Run], normal: bool) -> dict[str, list[float]] | None:
    """Return how much each record of a run weighs, by the run's name; None where all weigh alike.

    The records are what the run records and, where they are fitted beside it, N1 and N2. Weights of
    the former are those that they would have without the others.
    """
    places, kinds, left = [], [], []
    for flow, run in zip(seen.flows, runs, strict=True):
        predicted = seen.outcome.predictions[flow.key]
        if predicted is None:
            return None
        for place, (quantity, column) in enumerate(zip(QUANTITIES, OBSERVED, strict=True)):
            record = getattr(run, column)
            if record is None or (place > 0 and not (normal and np.any(record))):
                continue
            even = flow.even(record)
            size = rms(even * record) or 1.0
            left.append(even * (predicted[quantity] - record) / size)
            places.append((run.name, place))
            kinds.append(kind_of_record(run) + (f", {quantity}" if place else ""))
    found = weights_by_noise(left, kinds, seen.random)
    if found is None:
        return None
    of = dict(zip(places, found, strict=True))
    unit = np.mean([1.0 / weight for (_, place), weight in of.items() if place == 0])
    return {
        run.name: [float(unit) * of.get((run.name, place), 1.0) for place in range(3)]
        for run in runs
    }


def _weighed(run: Run, weights: Mapping[str, Sequence[float]]) -> Run:
    """Return a run with its weights; one that is not fitted keeps its own."""
    if run.name not in weights:
        return run
    own, first, second = weights[run.name]
    return replace(run, weight=own, normal_weights=(first, second))
