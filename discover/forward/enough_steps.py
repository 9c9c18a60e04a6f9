"""Steps short enough for chains that retract faster than the flow turns them."""

import numpy as np

from discover.forward.fluids import solve_batch
from discover.forward.grids.flow_batch import FlowBatch
from discover.laws.multimode import Fluid
from discover.protocols.kinematics import FOLLOWED

_TOLERANCE = 1e-4
"""Change of the recorded stress on halving every step, relative to its size in the run."""

_MOST_PIECES = 8
"""What is observed of every step is kept, and more would not fit into memory."""


def in_enough_steps(fluid: Fluid, flows: FlowBatch) -> FlowBatch:
    """Return flows in steps that follow a fluid's chains as they retract.

    The length of steps is chosen by the flow, which is what all else in a law follows. Of a law
    that does not retract they are returned as they are.

    `fluid`: the fluid; where it runs away steps stay as they are. `flows`: from `lay_out`.
    """
    followed = all(protocols.control in FOLLOWED for protocols, _ in flows.parts)
    if not fluid.law.retracts or not followed:
        return flows
    pieces, coarse = 1, np.asarray(solve_batch(fluid, flows))
    while pieces < _MOST_PIECES:
        finer = flows.in_pieces(2 * pieces)
        fine = np.asarray(solve_batch(fluid, finer))
        size = np.sqrt(np.mean(fine**2, axis=(1, 2)))
        apart = np.sqrt(np.mean((fine - coarse) ** 2, axis=(1, 2)))
        # not a number where the shorter steps run away too
        if not np.any(apart > _TOLERANCE * size) and np.all(np.isfinite(apart)):
            break
        pieces, coarse = 2 * pieces, fine
    else:
        if not np.all(np.isfinite(coarse)):
            return flows
    return flows.in_pieces(pieces)
