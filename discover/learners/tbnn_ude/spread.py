"""How far the members of an ensemble disagree: in their coefficients, and in what they predict.

All members fit the same σ12. Where they disagree, the data leave it to the initial weights: a wide
band on N1 or N2 is a warning. A narrow one is no promise, since all members share their tensors,
the prior and the recipe.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from discover.laws.multimode import Fluid
from discover.laws.tensor_basis_network import TensorBasisNetwork
from discover.learners.tbnn_ude.prior import Cloud
from discover.protocols.protocol import FlowProtocol
from discover.simulate.solve import SimulationError, observe
from tensor_library.integrity_basis import TENSOR_NAMES


@dataclass(frozen=True)
class MemberPredictions:
    """What every member of an ensemble predicts in one flow.

    `sigma12`, `N1`, `N2` in Pa, shape (members, n); nan throughout for a member that runs away.
    """

    times: Float[np.ndarray, " n"]  # in s, shape (n,)
    sigma12: Float[np.ndarray, "members n"]
    N1: Float[np.ndarray, "members n"]
    N2: Float[np.ndarray, "members n"]

    def band(self, quantity: str) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
        """Return the lowest and the highest prediction at each time; nan where all ran away.

        `quantity`: ``"sigma12"``, ``"N1"`` or ``"N2"``.
        """
        values = getattr(self, quantity)
        kept = values[~np.any(np.isnan(values), axis=1)]
        if not len(kept):
            return np.full(self.times.shape, np.nan), np.full(self.times.shape, np.nan)
        return np.min(kept, axis=0), np.max(kept, axis=0)


def member_predictions(
    fluids: Sequence[Fluid], protocol: FlowProtocol, times: Float[np.ndarray, " n"]
) -> MemberPredictions:
    """Return what is recorded of every member in a flow, and its normal stress differences.

    `fluids`: the members, as `TBNNUDE.ensemble_fluids_` holds them.
    """
    rows = np.full((3, len(fluids), len(times)), np.nan)
    for i, fluid in enumerate(fluids):
        try:
            rows[:, i] = observe(fluid, protocol, times).T
        except SimulationError:
            continue  # that it ran away is the answer
    return MemberPredictions(np.asarray(times, dtype=float), *rows)


def coefficient_spread(members: Sequence[TensorBasisNetwork], cloud: Cloud) -> dict[str, float]:
    """Return, by tensor, the standard deviation of gₙ over members, rms over states of training."""
    values = np.stack([np.asarray(cloud.coefficients(member)) for member in members])
    rms = np.sqrt(np.mean(np.var(values, axis=0), axis=0))
    return dict(zip(TENSOR_NAMES, map(float, rms), strict=True))
