"""Learners on runs that are weighed by their own noise, where equal weights will not do."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from discover.comparison.fitting.prepared import with_each_run
from discover.comparison.instrument.known import Known
from discover.comparison.judging.explanation import what_it_leaves
from discover.comparison.learning import Learning
from discover.comparison.outcomes.expected import expectation_of
from discover.comparison.outcomes.flows import Flow
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
    if _BY_ITS_LAW not in own:
        return learnt
    seen = _seen(study, known, own)
    weights = _weights(seen, data)
    if weights is None:
        return learnt
    progress("runs differ in noise: once more, each run weighed by its own", 1.0)
    weighed = with_each_run(data, lambda run: replace(run, weight=weights.get(run.name, 1.0)))
    there = known_in(weighed)
    again = replace(learning, prefix="by_noise_").outcomes(list(own), there, progress)
    before, after = ({t.term for t in of[_BY_ITS_LAW].terms} for of in (own, again))
    if after <= before and _seen(study, there, again).explained:
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


def _weights(seen: _Seen, data: StudyData) -> dict[str, float] | None:
    """Return the weight of each run by name; None where equal weights are as good."""
    left = []
    for flow in seen.flows:
        predicted = seen.outcome.predictions[flow.key]
        if predicted is None:
            return None
        record = np.asarray(flow.measured, dtype=float)
        even = flow.even(record)
        size = float(np.sqrt(np.mean((even * record) ** 2))) or 1.0
        left.append(even * (predicted["sigma12"] - record) / size)
    runs = data.fit.runs
    weights = weights_by_noise(left, list(map(kind_of_record, runs)), seen.random)
    if weights is None:
        return None
    return {run.name: weight for run, weight in zip(runs, weights, strict=True)}
