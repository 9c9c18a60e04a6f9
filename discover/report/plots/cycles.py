"""The last cycle of an oscillation, as Lissajous curves show it."""

import numpy as np
from jaxtyping import Bool, Float


def in_last_cycle(times: Float[np.ndarray, " n"], frequency: float) -> Bool[np.ndarray, " n"]:
    """Return which samples lie in the last cycle, a little more so that it closes.

    Parameters
    ----------
    times
        In s, increasing, shape (n,).
    frequency
        Angular, in 1/s.
    """
    return times >= times[-1] - 2.0 * np.pi / frequency * 1.02


def about_middle(
    strain: Float[np.ndarray, " n"], cycle: Bool[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """Return the strain about the middle of the range that it has in a cycle."""
    return strain - 0.5 * (strain[cycle].max() + strain[cycle].min())
