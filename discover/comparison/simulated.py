"""A fluid in all flows of a comparison at once, and whether it is sound there."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from discover import identify
from discover.comparison.flows import Flow, Stresses, columns_of
from discover.identify.physics_flows import time_scale
from discover.laws import Fluid

_PHYSICS_FLOWS = ("training", "held_out", "test")


@dataclass(frozen=True)
class Simulated:
    """What a fluid does in flows.

    `predictions`: by the key of the flow; None where the law diverges. `seen`: what the checks of
    its physics are made of.
    """

    predictions: Mapping[str, Stresses | None]
    seen: identify.Seen


def simulated(fluid: Fluid, flows: Sequence[Flow]) -> Simulated:
    """Return what a fluid does in flows.

    Training flows set the box beyond which the law extrapolates.
    """
    along = [flow for flow in flows if flow.kind in _PHYSICS_FLOWS]
    training = [flow for flow in along if flow.kind == "training"] or along
    time = time_scale(fluid)
    weissenberg = time * max(flow.largest_rate for flow in training)
    deborah = time * max(_frequency(flow) for flow in training)
    protocols, times = [flow.protocol for flow in flows], [flow.times for flow in flows]
    # a start-up has no frequency; no oscillation tried is larger than a strain of fifty
    seen = identify.see(fluid, protocols, times, weissenberg, max(deborah, weissenberg / 5.0))
    pairs = zip(flows, seen.along.observed, strict=True)
    return Simulated(
        {flow.key: columns_of(o) if np.all(np.isfinite(o)) else None for flow, o in pairs}, seen
    )


def physics_of(found: Simulated, flows: Sequence[Flow]) -> dict[str, Any]:
    """Return checks of a fluid's physical soundness along the flows, as JSON-able values."""
    names = {i: flow.title for i, flow in enumerate(flows) if flow.kind in _PHYSICS_FLOWS}
    return identify.check_physics(found.seen, names).to_json()


def _frequency(flow: Flow) -> float:
    """Return the angular frequency of a flow, in rad/s; that of its duration if it has none."""
    if flow.is_of_states:
        return flow.frequency or 0.0
    whole = 2.0 * np.pi / max(float(flow.times[-1]), np.finfo(float).tiny)
    return max(whole, flow.frequency or 0.0)
