"""Learners on runs that are weighed by their own noise, where equal weights will not do."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from discover.comparison.fitting.prepared import with_each_run
from discover.comparison.instrument.known import Known
from discover.comparison.judging.explanation import what_it_leaves
from discover.comparison.learning import Learning
from discover.comparison.outcomes.expected import expectation_of
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.dataset.repeats import repeats_among
from discover.dataset.run_table import kind_of_record
from discover.progress import Progress
from discover.statistics.noise_weights import weights_by_noise
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
    known, own = learnt
    weights = None if _BY_ITS_LAW not in own else _weights(study, data, known, own[_BY_ITS_LAW])
    if weights is None:
        return learnt
    progress("runs differ in noise: once more, each run weighed by its own", 1.0)
    weighed = with_each_run(data, lambda run: replace(run, weight=weights.get(run.name, 1.0)))
    there = known_in(weighed)
    again = replace(learning, prefix="by_noise_").outcomes(list(own), there, progress)
    before, after = ({t.term for t in of[_BY_ITS_LAW].terms} for of in (own, again))
    if after <= before and _explains(study, there, again[_BY_ITS_LAW]):
        return there, again
    return learnt


def _weights(
    study: Study, data: StudyData, known: Known, own: LearnerOutcome
) -> dict[str, float] | None:
    """Return the weight of each run by name; None where equal weights are as good."""
    outcome, left = known.frame(own).outcome(own), []
    for flow in known.flows:
        if flow.kind != "training":
            continue
        predicted = outcome.predictions[flow.key]
        if predicted is None:
            return None
        record = np.asarray(flow.measured, dtype=float)
        even = flow.even(record)
        size = float(np.sqrt(np.mean((even * record) ** 2))) or 1.0
        left.append(even * (predicted["sigma12"] - record) / size)
    runs = data.fit.runs
    weights = weights_by_noise(left, list(map(kind_of_record, runs)), _explains(study, known, own))
    if weights is None:
        return None
    return {run.name: weight for run, weight in zip(runs, weights, strict=True)}


def _explains(study: Study, known: Known, own: LearnerOutcome) -> bool:
    """Return whether what a learner's law leaves of the fitted runs is noise."""
    repeats = repeats_among(list(known.before.data.dataset))
    expectation = expectation_of(study, known.before.model, repeats)
    flows = [flow for flow in known.flows if flow.kind == "training"]
    outcome, normal = known.frame(own).outcome(own), study.compare.use_normal_stresses
    return what_it_leaves(outcome, flows, expectation, normal).verdict == "explained"
