"""Runs held out of a comparison: a law that they refute explains nothing."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from discover.comparison.judging.band_check import IN_NOISE
from discover.comparison.judging.explanation import ARITHMETIC, Explanation, least_seen
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome, Limits
from discover.identify.rivals.bands import PredictionBand
from discover.statistics import HALF_BAND, LackOfFit, noise_model
from discover.statistics.lack_of_fit import what_is_left
from discover.statistics.projection import rms
from discover.statistics.residual import Expectation
from discover.statistics.unseen import CARRIED, Unseen, refutes
from discover.words import percent_of

_OUTSIDE = 0.1
"""Of a 95 % band so many of a run's samples may not lie outside, knocks among them."""


def hold_against_unseen(
    explanation: Explanation,
    outcomes: Mapping[str, LearnerOutcome],
    flows: Iterable[Flow],
    bands: Mapping[str, PredictionBand],
    expectation: Expectation,
    banded: str = "tensor_sindy",
) -> Explanation:
    """Return what explains the training runs and is not refuted by measured runs held out.

    Parameters
    ----------
    bands
        Of one law, by the key of the flow.
    expectation
        What a complete law may leave.
    banded
        Whose law that is: the sparse one.
    """
    flows = list(flows)
    training = [flow for flow in flows if flow.kind == "training"]
    unseen = [
        flow
        for flow in flows
        if flow.kind == "held_out" and not flow.is_truth and "sigma12" in flow.reference
    ]
    if not unseen:
        return _held_against_folds(explanation, outcomes)
    found, outliers = dict(explanation.lack_of_fit), {}
    for name in explanation.by:
        outliers[name] = outliers_of(outcomes[name], unseen, expectation)
        own = bands if name == banded else None
        columns = [
            flow.even(_measured(flow)) * changes_along(outcomes[name], flow, own) for flow in unseen
        ]
        reason = _refuted(
            outcomes[name], training, unseen, columns, found[name], expectation, outliers[name]
        )
        if reason:
            found[name] = found[name].refuted(reason)
    return replace(explanation, lack_of_fit=found, outliers=outliers)


def misses(limits: Limits, flow: Flow, noise: float) -> float:
    """Return the share of a held-out record that a band of σ12 misses, zero where it holds it.

    Parameters
    ----------
    limits
        The band in the flow.
    flow
        Any; only the record of a run held out says something.
    noise
        Relative noise of the records.
    """
    record = flow.reference.get("sigma12")
    if flow.kind != "held_out" or flow.is_truth or record is None:
        return 0.0
    record = np.asarray(record)
    allowed = IN_NOISE * noise * rms(record)
    share = float(np.mean(np.abs(record - np.clip(record, *limits["sigma12"])) > allowed))
    return share if share > _OUTSIDE else 0.0


def _held_against_folds(
    explanation: Explanation, outcomes: Mapping[str, LearnerOutcome]
) -> Explanation:
    """Return what is not refuted by runs that a fit leaves out in turn, where none is held out.

    Terms that together follow a few runs by chance miss most of the runs left out by far more than
    noise. One that is missed may be the only one that tells a constant.
    """
    found = dict(explanation.lack_of_fit)
    for name in explanation.by:
        details, left = outcomes[name].details, found[name]
        if not outcomes[name].terms or details.get("chosen") is None:
            continue
        by_run = details["path"][details["chosen"]].get("held_out_by_run") or {}
        # None and nan are a law that runs away
        errors = np.nan_to_num(np.array([*by_run.values()], dtype=float), nan=np.inf)
        limit = CARRIED * max(left.misfit, left.expected, ARITHMETIC)
        if len(errors) > 1 and np.mean(errors > limit) > 0.5:
            found[name] = left.refuted(
                f"most runs are missed by more than {percent_of(limit)} where they are left out of "
                f"the fit; all runs together by {percent_of(left.misfit)}"
            )
    return replace(explanation, lack_of_fit=found)


def outliers_of(
    outcome: LearnerOutcome, runs: Sequence[Flow], expectation: Expectation
) -> dict[str, tuple[int, ...]]:
    """Return which samples of measured runs are outliers, by the key of the run."""
    told = [(flow, row) for flow in runs if (row := _residual(outcome, flow)) is not None]
    if not told:
        return {}
    records = [_record(flow) for flow, _ in told]
    left = what_is_left([row for _, row in told], records, expectation)
    pairs = zip(told, left.outlier_samples, strict=True)
    return {flow.key: samples for (flow, _), samples in pairs if samples}


def _refuted(
    outcome: LearnerOutcome,
    training: Sequence[Flow],
    unseen: Sequence[Flow],
    columns: Sequence[np.ndarray],
    left: LackOfFit,
    expectation: Expectation,
    outliers: Mapping[str, tuple[int, ...]],
) -> str:
    """Return why the runs held out refute a law, in words; empty if they do not."""
    residuals, records = [], []
    for flow in unseen:
        residual = _residual(outcome, flow)
        if residual is None:
            return f"the law runs away in {flow.name}, a run held out"
        residuals.append(residual)
        records.append(_record(flow))
    # knocks in a run held out refute no law, as they do not where it was fitted
    knocks = [list(outliers.get(flow.key, ())) for flow in unseen]
    residuals, records, columns = (
        [np.delete(row, out, axis=-1) for row, out in zip(part, knocks, strict=True)]
        for part in (residuals, records, columns)
    )
    pairs = zip(residuals, records, strict=True)
    missed = float(np.mean([rms(row) / (rms(record) or 1.0) for row, record in pairs]))
    if missed <= least_seen(outcome):
        return ""
    fitted = [row for flow in training if (row := _residual(outcome, flow)) is not None]
    known = [_record(flow) for flow in training]
    # stresses and strains beside one another: each run says how its own noise is correlated
    alike = [row / (rms(row) or 1.0) for row in fitted]
    against = Unseen(residuals, records, columns, noise_model(alike).correlation)
    told = all(len(column) for column in columns)  # how uncertain the constants are
    if told and refutes(against, fitted, known, expectation):
        return (
            f"runs held out are missed by {percent_of(missed)}, more than noise and uncertain "
            "constants leave"
        )
    if missed > CARRIED * max(left.misfit, left.expected, ARITHMETIC):
        return (
            f"runs held out are missed by {percent_of(missed)}, those of training by "
            f"{percent_of(left.misfit)}"
        )
    return ""


def _measured(flow: Flow) -> np.ndarray:
    record = flow.measured if flow.kind == "training" else flow.reference["sigma12"]
    return np.asarray(record, dtype=float)


def _record(flow: Flow) -> np.ndarray:
    """Return what was measured, so told that noise has one size in all of it."""
    return flow.even(_measured(flow)) * _measured(flow)


def _residual(outcome: LearnerOutcome, flow: Flow) -> np.ndarray | None:
    predicted = outcome.predictions.get(flow.key)
    record = _measured(flow)
    if predicted is None or not np.all(np.isfinite(predicted["sigma12"])):
        return None
    return flow.even(record) * (predicted["sigma12"] - record)


def changes_along(
    outcome: LearnerOutcome, flow: Flow, bands: Mapping[str, PredictionBand] | None
) -> Float[np.ndarray, "directions n"]:
    """Return changes of σ12 by one standard deviation each; none, shape (0, n), where not known.

    Parameters
    ----------
    outcome
        Of a learner.
    flow
        Any that is drawn.
    bands
        Of its law, by the key of the flow; None where it has its own.
    """
    if bands is not None:
        band = bands.get(flow.key)
        directions = None if band is None else band.directions
        return np.zeros((0, len(flow.times))) if directions is None else directions
    limits = outcome.bands.get(flow.key)
    if limits is None:
        return np.zeros((0, len(flow.times)))
    low, high = limits["sigma12"]
    return (high - low)[None] / (2.0 * HALF_BAND)
