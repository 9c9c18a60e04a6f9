"""What the dense library's bands leave of a statement that takes it that the law is sparse."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from discover.comparison.judging.identifiability import SEPARATED
from discover.comparison.judging.statements import WIDEST, Statement
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.words import percent_of

DENSE = "tensor_dense"


def open_where_dense_is_wide(
    statements: Sequence[Statement],
    outcomes: Mapping[str, LearnerOutcome],
    flows: Sequence[Flow],
) -> list[Statement]:
    """Return the statements, with what the dense library leaves open no longer determined.

    A sparse law's band may be narrow because the law is sparse and for no other reason. So a
    quantity counts as determined only if the dense library's band is narrower than the quantity in
    every flow, and holds what the sparse law predicts.

    Parameters
    ----------
    statements
        On N1 and N2.
    outcomes
        By learner; without ``"tensor_dense"`` the statements stay as they are.
    flows
        Flows to look at: tests and held-out runs.
    """
    dense = outcomes.get(DENSE)
    if dense is None:
        return list(statements)
    return [s if s.undetermined else _held(s, dense, outcomes, flows) for s in statements]


def _held(
    statement: Statement,
    dense: LearnerOutcome,
    outcomes: Mapping[str, LearnerOutcome],
    flows: Sequence[Flow],
) -> Statement:
    quantity = statement.quantity
    of = "N1" if quantity == "N2" else "its size"
    widest = 0.0
    for flow in flows:
        width = dense.half_widths(flow).get(quantity)
        if width is None:
            return _opened(statement, f"in {flow.title} the dense library has no band")
        if not width < WIDEST:
            text = (
                f"in {flow.title} the dense library leaves it open by ± {percent_of(width)} of {of}"
            )
            return _opened(statement, text)
        off = _outside(dense, outcomes.get("tensor_sindy"), flow, quantity)
        if off > SEPARATED:
            text = (
                f"in {flow.title} the sparse law's {quantity} lies outside the dense library's "
                f"band, by {percent_of(off)} of {of}"
            )
            return _opened(statement, text)
        widest = max(widest, width)
    told = (
        f"The dense library, which does not take it that the law is sparse, leaves ± "
        f"{percent_of(widest)} of {of} at the widest."
    )
    return replace(statement, text=f"{statement.text} {told}") if flows else statement


def _outside(
    dense: LearnerOutcome, sparse: LearnerOutcome | None, flow: Flow, quantity: str
) -> float:
    """Return how far the sparse law's prediction lies outside the dense band, relative."""
    limits = dense.bands.get(flow.key)
    predicted = None if sparse is None else sparse.predictions.get(flow.key)
    if limits is None or predicted is None:
        return 0.0
    low, high = limits[quantity]
    size = float(np.linalg.norm(predicted["N1" if quantity == "N2" else quantity]))
    gap = predicted[quantity] - np.clip(predicted[quantity], low, high)
    return float(np.linalg.norm(gap)) / size if size > 0 else 0.0


def _opened(statement: Statement, reason: str) -> Statement:
    text = f"{reason[:1].upper()}{reason[1:]}. {statement.text}"
    return replace(statement, determined="no", text=text)
