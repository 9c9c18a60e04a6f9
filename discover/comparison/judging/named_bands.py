"""What explains the runs and has a name takes part in the dense library's band."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from discover.comparison.fitting.named_effects import NamedExplanation
from discover.comparison.judging.dense_library import DENSE, NAMED_ALONE, misses
from discover.comparison.outcomes.flows import QUANTITIES, Flow
from discover.comparison.outcomes.outcome import LearnerOutcome, Limits
from discover.statistics.lack_of_fit import LackOfFit
from discover.statistics.mixed_normals import quantile
from discover.words import listed, percent_of

_LEVELS = (0.025, 0.5, 0.975)
_TOLD = 3  # explanations in a sentence


def with_named_effects(
    outcomes: Mapping[str, LearnerOutcome],
    flows: Sequence[Flow],
    found: Sequence[NamedExplanation],
    left: LackOfFit | None,
) -> tuple[dict[str, LearnerOutcome], list[str]]:
    """Return the outcomes, dense bands with what explains the runs and has a name, and sentences.

    The band of a flow is the hull of two: that of the library's laws, unless a named explanation
    leaves so much less of the fitted runs that they count no longer, and that of the named
    explanations, weighted by their evidence, unless σ12 of a run held out lies outside of it.

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
    bands, predictions, alone = dict(dense.bands), dict(dense.predictions), []
    took_part = False
    for flow in flows:
        if flow.key not in bands:
            continue
        own = None if beaten else bands[flow.key]
        named = _band(found, flow)
        if named is not None and misses(named[0], flow, found[0].left.noise):
            named = None
        if named is None:
            bands[flow.key] = own
            continue
        took_part = True
        if own is None:
            alone.append(flow.key)
            bands[flow.key], predictions[flow.key] = named
        else:
            bands[flow.key] = {
                q: (np.minimum(own[q][0], low), np.maximum(own[q][1], high))
                for q, (low, high) in named[0].items()
            }
    details = {**dense.details, "named_effects": _rows(found), NAMED_ALONE: alone}
    changed = replace(dense, bands=bands, predictions=predictions, details=details)
    said = _said(found, left, beaten, took_part, bool(alone))
    return {**outcomes, DENSE: changed}, said


def _band(
    found: Sequence[NamedExplanation], flow: Flow
) -> tuple[Limits, dict[str, np.ndarray]] | None:
    """Return the 95 % band of the explanations in a flow, and its middle; None without one."""
    told = [one for one in found if flow.key in one.predicted]
    if not told:
        return None
    weights = np.exp(-0.5 * np.array([one.criterion - told[0].criterion for one in told]))
    share = (weights / np.sum(weights))[:, None]
    limits: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    middle = {}
    for quantity in QUANTITIES:
        pairs = [one.predicted[flow.key][quantity] for one in told]
        mean, deviation = (np.stack(part) for part in zip(*pairs, strict=True))
        deviation = np.maximum(deviation, np.finfo(float).tiny)
        low, middle[quantity], high = (quantile(mean, deviation, share, p) for p in _LEVELS)
        limits[quantity] = low, high
    return limits, middle


def _rows(found: Sequence[NamedExplanation]) -> list[dict[str, object]]:
    return [
        {
            "effects": list(one.effects),
            "misfit": one.left.misfit,
            "criterion_above_first": one.criterion - found[0].criterion,
        }
        for one in found
    ]


def _said(
    found: Sequence[NamedExplanation],
    left: LackOfFit | None,
    beaten: bool,
    took_part: bool,
    alone: bool,
) -> list[str]:
    if not took_part:
        return []
    names = listed([one.title for one in found[:_TOLD]])
    if beaten and left is not None:
        return [
            f"The dense library leaves {percent_of(left.misfit)} of the fitted runs and "
            f"{found[0].title} {percent_of(found[0].left.misfit)}, so its band is that of what has "
            f"a name and explains the runs: {names}."
        ]
    if alone:
        return [
            "Where none of the dense library's own laws is left, its band is that of what has a "
            f"name and explains the runs: {names}."
        ]
    return []
