"""Flow curves, padded: a sample is a steady state."""

from collections.abc import Sequence

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float

from discover.dataset import Run
from discover.programs import on_device
from discover.protocols.kinematics import Kinematics, stack_kinematics


class SteadyFlows(eqx.Module):
    """Flow curves, padded, with a leading axis of runs: a sample is a steady state at its rate.

    Attributes
    ----------
    rate
        In 1/s, shape (runs, n).
    kinematics
        As in `TransientFlows`.
    """

    rate: Float[Array, "runs n"]
    kinematics: Kinematics | None = None

    @property
    def longest(self) -> float:
        """Zero: a steady state knows no time."""
        return 0.0


def steady_states(runs: Sequence[Run]) -> SteadyFlows:
    """Return the flows of flow curves."""
    n = max(len(run) for run in runs)
    # a padded sample is one more of the last
    rates = [np.pad(run.rate, (0, n - len(run)), mode="edge") for run in runs]
    kinematics = stack_kinematics([run.protocol.kinematics for run in runs])
    return SteadyFlows(on_device(np.stack(rates)), kinematics)
