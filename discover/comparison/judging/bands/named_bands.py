"""What explains the runs and has a name takes part in the dense library's band."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import ndtri

from discover.comparison.fitting.named_effects import NamedExplanation
from discover.comparison.judging.bands.dense_library import DENSE, NAMED_BESIDE
from discover.comparison.judging.unseen_runs import misses
from discover.comparison.outcomes.flows import QUANTITIES, Flow
from discover.comparison.outcomes.outcome import LearnerOutcome, Limits

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
    for flow in flows:
        own, named = bands.get(flow.key), _band(found, flow)
        if own is None or named is None or misses(named, flow, noise):
            continue
        beside.append(flow.key)
        bands[flow.key] = {
            q: (np.minimum(own[q][0], low), np.maximum(own[q][1], high))
            for q, (low, high) in named.items()
        }
    details = {**dense.details, "named_effects": _rows(found), NAMED_BESIDE: beside}
    return {**outcomes, DENSE: replace(dense, bands=bands, details=details)}


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
