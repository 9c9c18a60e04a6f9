"""What explains the runs and has a name takes part in the bands of both libraries."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import ndtri

from discover.comparison.fitting.named_effects import NamedExplanation
from discover.comparison.judging.bands.dense_library import DENSE, NAMED_BESIDE
from discover.comparison.judging.statements import Statement
from discover.comparison.judging.unseen_runs import misses
from discover.comparison.outcomes.flows import QUANTITIES, Flow
from discover.comparison.outcomes.outcome import LearnerOutcome, Limits
from discover.identify.rivals.bands import PredictionBand
from discover.words import listed

_WITHIN = float(ndtri(0.975))
"""Standard deviations to either side that hold 95 %."""


def with_named_effects(
    outcomes: Mapping[str, LearnerOutcome],
    flows: Sequence[Flow],
    found: Sequence[NamedExplanation],
) -> dict[str, LearnerOutcome]:
    """Return the outcomes, dense bands holding what explains the runs and has a name too.

    The band of a flow is the hull of that of the library's laws and of those of the named
    explanations, unless σ12 of a run held out lies outside of theirs. They make it wider and never
    narrower: of two that explain σ12 alike, the wrong one may be the only one with a name. Where
    the library's laws have no band there is none.
    """
    dense = outcomes.get(DENSE)
    if dense is None or not dense.bands or not found:
        return dict(outcomes)
    noise = max(one.left.noise for one in found)
    bands = dict(dense.bands)
    beside: list[str] = []
    for key, named in _not_refuted(found, flows, noise).items():
        own = bands.get(key)
        if own is None:
            continue
        beside.append(key)
        bands[key] = {
            q: (np.minimum(own[q][0], low), np.maximum(own[q][1], high))
            for q, (low, high) in named.items()
        }
    details = {**dense.details, "named_effects": _rows(found), NAMED_BESIDE: beside}
    return {**outcomes, DENSE: replace(dense, bands=bands, details=details)}


def holding_named_effects(
    bands: Mapping[str, PredictionBand],
    flows: Sequence[Flow],
    found: Sequence[NamedExplanation],
    noise: float,
) -> dict[str, PredictionBand]:
    """Return bands of the sparse law that hold what explains the runs and has a name as well.

    A law of some terms follows a fluid that the library does not hold, or one behind a flaw, to
    the noise, and its constants are then known far better than its shape is.

    Parameters
    ----------
    bands
        Of the sparse law and its rivals, by the key of the flow.
    flows, found
        As in `with_named_effects`.
    noise
        Relative, of the records.
    """
    wider = dict(bands)
    for key, named in _not_refuted(found, flows, noise).items():
        own = wider.get(key)
        if own is not None:
            low, high = (np.stack(ends, axis=-1) for ends in zip(*named.values(), strict=True))
            wider[key] = replace(
                own,
                rivals_low=np.minimum(own.rivals_low, low),
                rivals_high=np.maximum(own.rivals_high, high),
            )
    return wider


def with_named_told(
    statements: Sequence[Statement], found: Sequence[NamedExplanation]
) -> list[Statement]:
    """Return the statements, those of what is determined with what their bands hold beside."""
    names = [" + ".join(one.effects) for one in found if one.effects]
    if not names:
        return list(statements)
    text = f"The band also holds what has a name and explains the runs: {listed(names)}."
    return [
        s if s.undetermined or not s.of_law else replace(s, text=f"{s.text} {text}")
        for s in statements
    ]


def _not_refuted(
    found: Sequence[NamedExplanation], flows: Sequence[Flow], noise: float
) -> dict[str, Limits]:
    """Return bands of explanations, by the key of the flow, unless a run held out misses them."""
    bands = {flow.key: (flow, _band(found, flow)) for flow in flows}
    return {
        key: band
        for key, (flow, band) in bands.items()
        if band is not None and not misses(band, flow, noise)
    }


def _band(found: Sequence[NamedExplanation], flow: Flow) -> Limits | None:
    """Return the hull of the 95 % bands of the explanations in a flow.

    Twins of σ12 may differ in N1 by far more than either is uncertain, and a little evidence
    between them says nothing: each has its whole band. None where none can be followed.
    """
    told = [one for one in found if flow.key in one.predicted]
    if not told:
        return None
    limits: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for quantity in QUANTITIES:
        pairs = [one.predicted[flow.key][quantity] for one in told]
        mean, deviation = (np.stack(part) for part in zip(*pairs, strict=True))
        half = _WITHIN * deviation
        limits[quantity] = np.min(mean - half, axis=0), np.max(mean + half, axis=0)
    return limits


def _rows(found: Sequence[NamedExplanation]) -> list[dict[str, object]]:
    return [
        {
            "effects": list(one.effects),
            "misfit": one.left.misfit,
            "criterion_above_first": one.criterion - found[0].criterion,
        }
        for one in found
    ]
