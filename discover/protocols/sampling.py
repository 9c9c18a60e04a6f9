"""How often a record was sampled, where its noise is that of one instrument and mode of test."""

import numpy as np
from jaxtyping import Float

from discover.protocols.protocol import FlowProtocol


def sampling_interval(
    time: Float[np.ndarray, " n"], protocol: FlowProtocol, quantity: str = "sigma12"
) -> float:
    """Return the median time between neighbouring samples of a record, in s.

    Not a number of what other means record than those of a shear stress at a given rate, from rest:
    a strain, a normal stress, an extension, the points of a table of states, cycles that a
    rheometer has averaged. Their noise need not be correlated as that of the others.

    `time`: of the samples. `protocol`: what was imposed. `quantity`: what was recorded.
    """
    plain = protocol.control == "rate" and float(protocol.begins) == 0.0
    if not plain or {quantity, protocol.quantity} != {"sigma12"} or len(time) < 2:
        return float("nan")
    interval = float(np.median(np.diff(np.asarray(time, dtype=float))))
    return interval if interval > 0.0 else float("nan")
