"""What was measured, on padded samples, and how much each sample weighs."""

import numpy as np
from jaxtyping import Float

from discover.dataset import Run


def measured(run: Run, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return weights and values of a run's samples, padded with zeros."""
    scale = run.weight / (run.sizes(run.recorded) * np.sqrt(len(run)))
    pad = (0, n - len(run))
    return np.pad(scale, pad), np.pad(run.recorded, pad)


def even(weight: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return by what values of one run are divided so that their noise has one size.

    Ones but for a flow curve or a sweep, whose noise is in proportion to it.

    Parameters
    ----------
    weight
        Of its samples, without padding.
    """
    least = float(np.min(weight))
    return least / weight if np.ptp(weight) > 1e-9 * least else np.ones_like(weight)
