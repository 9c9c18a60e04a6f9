"""What explains the runs and has a name takes part in the dense library's band."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import ndtri

from discover.comparison.fitting.named_effects import NamedExplanation
from discover.comparison.judging.dense_library import DENSE, NAMED_ALONE, NAMED_BESIDE, misses
from discover.comparison.outcomes.flows import QUANTITIES, Flow
from discover.comparison.outcomes.outcome import LearnerOutcome, Limits
from discover.statistics.lack_of_fit import LackOfFit
from discover.words import listed, percent_of

_WITHIN = float(ndtri(0.975))
"""Standard deviations to either side that hold 95 %."""

_TOLD = 3  # explanations in a sentence


def with_named_effects(
    outcomes: Mapping[str, LearnerOutcome],
    flows: Sequence[Flow],
    found: Sequence[NamedExplanation],
    left: LackOfFit | None,
) -> tuple[dict[str, LearnerOutcome], list[str]]:
    """Return the outcomes, dense bands with what explains the runs and has a name, and sentences.

    The band of a flow is the hull of two: that of the library's laws, unless a named explanation
    leaves so much less of the fitted runs that they count no longer, and the hull
    of the bands of the named explanations, unless σ12 of a run held out lies outside of it.

    Parameters
    ----------
    outcomes
        By learner; without ``"tensor_dense"`` they stay as they are.
    flows
        All flows.
    found
        The named explanations, the most probable first.
    left
        What the dense library leaves of the fitted runs; None where that is not known.
    """
    dense = outcomes.get(DENSE)
    if dense is None or not dense.bands or not found:
        return dict(outcomes), []
    beaten = left is not None and found[0].far_better_than(left.misfit)
    noise = max(one.left.noise for one in found)
    bands, predictions = dict(dense.bands), dict(dense.predictions)
    beside: list[str] = []
    alone: list[str] = []
    for flow in flows:
        if flow.key not in bands:
            continue
        own = None if beaten else bands[flow.key]
        named = _band(found, flow)
        if named is not None and misses(named[0], flow, noise):
            named = None
        if named is None:
            bands[flow.key] = own
            continue
        if own is None:
            alone.append(flow.key)
            bands[flow.key], predictions[flow.key] = named
        else:
            beside.append(flow.key)
            bands[flow.key] = {
                q: (np.minimum(own[q][0], low), np.maximum(own[q][1], high))
                for q, (low, high) in named[0].items()
            }
    of_names = {"named_effects": _rows(found), NAMED_BESIDE: beside, NAMED_ALONE: alone}
    details = {**dense.details, **of_names}
    changed = replace(dense, bands=bands, predictions=predictions, details=details)
    said = [_said(found, left if beaten else None)] if alone else []
    return {**outcomes, DENSE: changed}, said


def _band(
    found: Sequence[NamedExplanation], flow: Flow
) -> tuple[Limits, dict[str, np.ndarray]] | None:
    """Return the hull of the 95 % bands of the explanations in a flow, and the first's curves.

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
    return limits, {q: told[0].predicted[flow.key][q][0] for q in QUANTITIES}


def _rows(found: Sequence[NamedExplanation]) -> list[dict[str, object]]:
    return [
        {
            "effects": list(one.effects),
            "misfit": one.left.misfit,
            "criterion_above_first": one.criterion - found[0].criterion,
        }
        for one in found
    ]


def _said(found: Sequence[NamedExplanation], beaten: LackOfFit | None) -> str:
    """Return that the band is that of named effects, and what the laws that they beat leave."""
    names = listed([one.title for one in found[:_TOLD]])
    if beaten is not None:
        return (
            f"The dense library leaves {percent_of(beaten.misfit)} of the fitted runs and "
            f"{found[0].title} {percent_of(found[0].left.misfit)}, so its band is that of what has "
            f"a name and explains the runs: {names}."
        )
    return (
        "Where none of the dense library's own laws is left, its band is that of what has a name "
        f"and explains the runs: {names}."
    )
