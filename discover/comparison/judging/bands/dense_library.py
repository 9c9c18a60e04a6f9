"""What the dense library's bands leave of a statement that takes it that the law is sparse."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from discover.comparison.judging.band_check import WIDEST
from discover.comparison.judging.constants.declared_constants import OtherConstant, other_gain
from discover.comparison.judging.explanation import what_it_leaves
from discover.comparison.judging.identifiability import SEPARATED
from discover.comparison.judging.statements import Statement
from discover.comparison.judging.unseen_runs import misses
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome, Limits
from discover.learners.tensor_dense.mixture import FITS
from discover.statistics.lack_of_fit import LackOfFit
from discover.statistics.noise.whiteness import SIGNIFICANCE
from discover.statistics.residual import Expectation
from discover.words import percent_of

DENSE = "tensor_dense"

NAMED_BESIDE = "flows_with_named_effects"
"""Detail of the dense library: keys of the flows whose band is that of effects with a name too."""

ANY_N2 = "flows_with_any_second_normal_stress"
"""Detail of the dense library: keys of the flows whose band of N2 holds that of any polymer."""

GREEN_BAND = (
    "Shaded in green is where 95 % of the laws that fit σ₁₂ lie, those of the dense library and "
    "what has a name: a range for a fluid that behaves like one of them, behind an instrument that "
    "is sound or has a flaw with a name, and no claim about any other."
)
"""Sentence of a picture that draws the dense library's band."""

_FLOOR = 1e-3
"""Relative misfit that the dense library takes no data to go below."""


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
    return [
        _beside_open(s, dense, flows) if s.undetermined else _held(s, dense, outcomes, flows)
        for s in statements
    ]


def with_gain_in_dense(
    outcomes: Mapping[str, LearnerOutcome], others: Sequence[OtherConstant]
) -> dict[str, LearnerOutcome]:
    """Return the outcomes, the dense bands of N1 and N2 holding behind a transducer's gain as well.

    The dense library has the term γ̇ too, and its laws take a wrong gain for another modulus.
    """
    dense, gain = outcomes.get(DENSE), other_gain(others)
    if dense is None or gain is None:
        return dict(outcomes)
    bands: dict[str, Limits | None] = {}
    for key, limits in dense.bands.items():
        bands[key] = limits and {
            quantity: (low, high)
            if quantity == "sigma12"
            else (np.minimum(low, low / gain), np.maximum(high, high / gain))
            for quantity, (low, high) in limits.items()
        }
    return {**outcomes, DENSE: replace(dense, bands=bands)}


def without_refuted_bands(
    outcomes: Mapping[str, LearnerOutcome],
    flows: Sequence[Flow],
    expectation: Expectation,
    normal_stresses_used: bool = False,
) -> tuple[dict[str, LearnerOutcome], list[str]]:
    """Return the outcomes without dense bands that a record refutes, and a sentence on each.

    Laws that miss the runs that they were fitted to are not the fluid's, nor are they in a flow
    where σ12 of a run held out lies outside their band: their N1 and N2 say nothing either.

    Parameters
    ----------
    outcomes
        By learner; without ``"tensor_dense"`` they stay as they are.
    flows
        All flows; those of training and measured runs held out are looked at.
    expectation
        What a complete law may leave.
    normal_stresses_used
        Whether measured normal stresses were part of the fit.
    """
    dense = outcomes.get(DENSE)
    if dense is None or not dense.bands:
        return dict(outcomes), []
    training = [flow for flow in flows if flow.kind == "training"]
    left = None
    if training:
        left = what_it_leaves(dense, training, expectation, normal_stresses_used)
    if left is not None and (why := _why_refuted(left)):
        text = (
            f"The dense library leaves {percent_of(left.misfit)} of the fitted runs {why}, so none "
            "of its laws is the fluid's: they have no band."
        )
        none = dict.fromkeys(dense.bands)
        return {**outcomes, DENSE: replace(dense, bands=none)}, [text]
    noise = float((dense.details.get("noise") or {}).get("relative") or 0.0)
    bands, said = dict(dense.bands), []
    for flow in flows:
        limits = bands.get(flow.key)
        if limits is None:
            continue
        if share := misses(limits, flow, noise):
            bands[flow.key] = None
            said.append(
                f"In {flow.title}, a run held out, {percent_of(share)} of the samples lie outside "
                "the dense library's band of σ12, so its laws have none there."
            )
    return {**outcomes, DENSE: replace(dense, bands=bands)}, said


def _why_refuted(left: LackOfFit) -> str:
    """Return why laws that leave this of the fitted runs are not the fluid's; empty if they may be.

    Those of a library of 64 terms that leave a pattern, however small, lack something that no term
    makes up for. Below the floor nothing was fitted.
    """
    if not left.misfit <= FITS * max(left.expected, _FLOOR):
        return f"where noise is {percent_of(left.expected)}"
    patterned = left.probability is not None and left.probability <= SIGNIFICANCE
    if left.verdict == "unexplained" and patterned and left.misfit > FITS * _FLOOR:
        return f"with {left.pattern}"
    return ""


def _beside_open(statement: Statement, dense: LearnerOutcome, flows: Sequence[Flow]) -> Statement:
    """Return an open statement with what the dense band, which is drawn all the same, holds."""
    quantity = statement.quantity
    widths = [w for f in flows if (w := dense.half_widths(f).get(quantity)) is not None]
    if not widths:
        return statement
    of = _size_of(quantity)
    told = (
        f"The green band (± {percent_of(max(widths))} of {of} at the widest) takes it for granted "
        "that the fluid behaves like one of the laws that fit σ12, of the dense library or with a "
        "name, and that the instrument is sound or has a flaw with a name: 95 % of those laws lie "
        f"in it. Shear stress cannot test that. {quantity} of a fluid unlike all of them, or "
        "behind an instrument with another flaw, may lie outside."
    )
    if quantity == "N2" and dense.details.get(ANY_N2):
        told += (
            " No law explains the runs, so the band holds all N2 from zero to −2/7 of N1 too, as "
            "polymer melts and solutions have it."
        )
    return replace(statement, text=f"{statement.text} {told}")


def _size_of(quantity: str) -> str:
    """Return in words in units of what a half-width is told."""
    return "N1" if quantity == "N2" else "its size"


def _held(
    statement: Statement,
    dense: LearnerOutcome,
    outcomes: Mapping[str, LearnerOutcome],
    flows: Sequence[Flow],
) -> Statement:
    quantity = statement.quantity
    of = _size_of(quantity)
    widest = 0.0
    for flow in flows:
        width = dense.half_widths(flow).get(quantity)
        if width is None:
            return _opened(statement, f"in {flow.title} no law of the dense library has a band")
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
