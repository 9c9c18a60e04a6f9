"""Where members of the network, or the two learners, disagree beyond what they claim.

All of them fit the same σ12. A member says nothing of its own error, a band of linearised intervals
nothing of laws outside of it; what the one predicts and the other excludes is not determined by
these data.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from discover.comparison.judging.identifiability import SEPARATED
from discover.comparison.judging.statements import Statement
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome, Limits
from discover.identify.rivals.bands import QUANTITIES, PredictionBand
from discover.words import percent_of

_SHOWN = {"sigma12": "σ12", "N1": "N1", "N2": "N2"}


@dataclass(frozen=True)
class _Gap:
    """How far two bands are apart, or one is wide, where it is most so."""

    flow: Flow
    size: float


def disagreements(
    outcomes: Mapping[str, LearnerOutcome],
    flows: Sequence[Flow],
    bands: Mapping[str, PredictionBand],
) -> list[str]:
    """Return one sentence for each disagreement and each band that is missing.

    Parameters
    ----------
    flows
        Flows to look at: tests and held-out runs.
    bands
        Of the sparse law, by the key of the flow.
    """
    said = [_without_band(outcomes, bands)]
    said += _members(outcomes.get("tbnn_ude"), flows)
    said += contested(outcomes, flows, bands).values()
    return [sentence for sentence in said if sentence]


def contested(
    outcomes: Mapping[str, LearnerOutcome],
    flows: Sequence[Flow],
    bands: Mapping[str, PredictionBand],
) -> dict[str, str]:
    """Return, by quantity, why it is not determined: the learners exclude each other there.

    Parameters as in `disagreements`.
    """
    sparse, network = outcomes.get("tensor_sindy"), outcomes.get("tbnn_ude")
    if sparse is None or network is None:
        return {}
    found: dict[str, _Gap] = {}
    for flow in flows:
        one = _limits_of_band(bands.get(flow.key)) or _alone(sparse, flow)
        other = network.bands.get(flow.key) or _alone(network, flow)
        predicted = sparse.predictions.get(flow.key)
        if one is None or other is None or predicted is None:
            continue
        for quantity in QUANTITIES:
            (low, high), (least, most) = one[quantity], other[quantity]
            apart = np.maximum(np.maximum(least - high, low - most), 0.0)
            size = float(np.linalg.norm(predicted["N1" if quantity == "N2" else quantity]))
            gap = float(np.linalg.norm(apart)) / size if size > 0 else 0.0
            if gap > SEPARATED and (quantity not in found or gap > found[quantity].size):
                found[quantity] = _Gap(flow, gap)
    return {
        quantity: (
            f"The two learners, trained on the same σ12, disagree on {_SHOWN[quantity]} beyond "
            f"their bands, by {percent_of(gap.size)} {_of(quantity)} in {gap.flow.title}"
            f"{_which(sparse, network, gap.flow, quantity)}."
        )
        for quantity, gap in found.items()
    }


def _which(sparse: LearnerOutcome, network: LearnerOutcome, flow: Flow, quantity: str) -> str:
    """Return by how much each misses what was measured, or that one of them is wrong."""
    measured = flow.reference.get(quantity)
    both = [who.predictions.get(flow.key) for who in (sparse, network)]
    if measured is None or flow.is_truth:
        return ": at least one of them is wrong there, and these data do not say which"
    size = float(np.linalg.norm(measured)) or 1.0
    missed = [
        percent_of(float(np.linalg.norm(one[quantity] - measured)) / size)
        for one in both
        if one is not None
    ]
    if len(missed) < len(both):  # a law that runs away; the page says that elsewhere
        return ": at least one of them is wrong there"
    return (
        f", where sparse regression misses what was measured by {missed[0]} and the network by "
        f"{missed[1]}"
    )


def open_where_contested(
    statements: Sequence[Statement], reasons: Mapping[str, str]
) -> list[Statement]:
    """Return the statements, with what the learners contest no longer determined."""
    return [
        s
        if (reason := reasons.get(s.quantity)) is None
        else replace(s, determined="no", text=f"{reason} {s.text}")
        for s in statements
    ]


def _members(network: LearnerOutcome | None, flows: Sequence[Flow]) -> list[str]:
    if network is None or not network.bands:
        return []
    lost = [flow.title for flow in flows if network.bands.get(flow.key, {}) is None]
    said = []
    if lost:
        said.append(
            f"Of the networks trained on the same σ12, one runs away in {lost[0]}: there the "
            "network says nothing."
        )
    for quantity in QUANTITIES:
        widths = [(network.half_widths(flow).get(quantity, 0.0), flow) for flow in flows]
        width, flow = max(widths, key=lambda pair: pair[0], default=(0.0, None))
        if flow is not None and width > SEPARATED:
            said.append(
                f"Networks trained on the same σ12 disagree on {_SHOWN[quantity]} by "
                f"±{percent_of(width)} {_of(quantity)} in {flow.title}."
            )
    return said


def _without_band(
    outcomes: Mapping[str, LearnerOutcome], bands: Mapping[str, PredictionBand]
) -> str:
    sparse = outcomes.get("tensor_sindy")
    draws = {} if sparse is None else sparse.details.get("draws") or {}
    if draws.get("reason"):
        return f"Sparse regression: {draws['reason']}."
    reason = next((band.reason for band in bands.values() if band.reason), "")
    return f"The sparse law has no band in some flow: {reason}." if reason else ""


def _limits_of_band(band: PredictionBand | None) -> Limits | None:
    if band is None or not np.all(np.isfinite(band.rivals_low)):
        return None
    return {q: (band.rivals_low[:, i], band.rivals_high[:, i]) for i, q in enumerate(QUANTITIES)}


def _alone(outcome: LearnerOutcome, flow: Flow) -> Limits | None:
    predicted = outcome.predictions.get(flow.key)
    return None if predicted is None else {q: (predicted[q], predicted[q]) for q in QUANTITIES}


def _of(quantity: str) -> str:
    return "of N1" if quantity == "N2" else "of its size"
