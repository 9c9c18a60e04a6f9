"""Measured runs of σ12 as a law predicts them, with what its uncertain constants change."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from discover.comparison.judging.explanation import Explanation
from discover.comparison.judging.unseen_runs import changes_along, outliers_of
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.identify.rivals.bands import PredictionBand

SPARSE = "tensor_sindy"

_SAME = 3e-2
"""Of the largest change that constants make: below it lies what is not linear in them."""


@dataclass(frozen=True)
class AsPredicted:
    """A run as a law predicts it, without outliers.

    Attributes
    ----------
    flow
        The run.
    times, predicted, residual
        Of the samples, the law, and that minus the record, shape (n,).
    columns
        Changes of the prediction along constants that were fitted, shape (constants, n).
    even
        By what they are multiplied so that noise has one size, shape (n,).
    kept
        Which samples of the run these are.
    """

    flow: Flow
    times: Float[np.ndarray, " n"]
    predicted: Float[np.ndarray, " n"]
    residual: Float[np.ndarray, " n"]
    columns: Float[np.ndarray, "constants n"]
    even: Float[np.ndarray, " n"]
    kept: Int[np.ndarray, " n"]


def runs_as_predicted(
    explanation: Explanation,
    name: str,
    outcome: LearnerOutcome,
    flows: Sequence[Flow],
    bands: Mapping[str, PredictionBand],
) -> list[AsPredicted]:
    """Return the runs as a law predicts them; none where it does not follow them all.

    Parameters
    ----------
    explanation
        What explains the runs, with the outliers of those held out.
    name, outcome
        Of a learner.
    flows
        Runs, fitted or held out.
    bands
        Of the sparse law, by the key of the flow.
    """
    training = [flow for flow in flows if flow.kind == "training"]
    knocks = outliers_of(outcome, training, explanation.expectation)
    knocks |= explanation.outliers.get(name, {})
    rows, changes = [], []
    for flow in flows:
        prediction = outcome.predictions.get(flow.key)
        record = flow.measured if flow.kind == "training" else flow.reference.get("sigma12")
        if prediction is None or record is None or not np.all(np.isfinite(prediction["sigma12"])):
            return []
        columns = changes_along(outcome, flow, bands if name == SPARSE else None)
        kept = np.delete(np.arange(len(flow.times)), list(knocks.get(flow.key, ())))
        stress = np.asarray(prediction["sigma12"], dtype=float)
        residual = stress - np.asarray(record)
        even = flow.even(np.asarray(record, dtype=float))
        rows.append((flow, flow.times[kept], stress[kept], residual[kept], even[kept], kept))
        changes.append(columns[:, kept])
    if outcome.terms and not all(len(change) for change in changes):
        return []  # how uncertain the constants are is not known
    return [
        AsPredicted(flow, times, stress, residual, change, even, kept)
        for (flow, times, stress, residual, even, kept), change in zip(
            rows, _independent(changes), strict=True
        )
    ]


def _independent(changes: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return as many combinations of the changes as differ, those of all runs together."""
    if len({len(change) for change in changes}) != 1 or not all(map(len, changes)):
        return [np.zeros((0, change.shape[1])) for change in changes]
    every = np.concatenate(changes, axis=1)
    if not np.all(np.isfinite(every)):
        return [np.zeros((0, change.shape[1])) for change in changes]
    _, size, rows = np.linalg.svd(every, full_matrices=False)
    kept = rows[size > _SAME * size[0]] if size[0] > 0.0 else rows[:0]
    ends = np.cumsum([change.shape[1] for change in changes])[:-1]
    return list(np.split(kept, ends, axis=1))
