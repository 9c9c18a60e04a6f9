"""Limits of a rougher grid, on which costly runs are followed while many trial laws are ranked.

A misfit of a per cent ranks laws as well in steps that err by a thousandth of the stress.
"""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from discover.forward.grids.flow_batch import FlowBatch
from discover.protocols.kinematics import STATES

AFFORDABLE = 6000.0
"""Modes times steps of all runs up to which every trial is made on the fine grid."""

WORTH_IT = 0.5
"""Share of the steps that a rough grid may have at most: it has programs of its own to compile."""

_STRAIN_STEP, _PHASE_STEP, _GROWTH = 0.4, 0.3, 0.1


def rough_limits(
    flows: FlowBatch, relaxation_time: Float[np.ndarray, " k"]
) -> Mapping[str, float] | None:
    """Return limits of longer steps, as `make_grid` takes them; None where the flows have none.

    Steps grow after a change of the rate, up to a strain of one. Where the fine grid follows the
    fastest relaxation, and else where it follows the slowest, so does the rough one: in steps of
    many relaxation times a law that relaxes faster than the known one runs away.
    """
    controls = {protocols.control for protocols, _ in flows.parts}
    if not controls <= {"rate", *STATES}:
        return None
    if "rate" not in controls:
        return {"strain_step": _STRAIN_STEP}
    longest = max(
        float(np.max(np.diff(grid.times, axis=1)))
        for protocols, grid in flows.parts
        if protocols.control == "rate"
    )
    times = np.asarray(relaxation_time)
    followed = float(np.min(times) if longest <= np.min(times) else np.max(times))
    return {
        "strain_step": _STRAIN_STEP,
        "phase_step": _PHASE_STEP,
        "growth": _GROWTH,
        "max_step": max(longest, followed),
    }
