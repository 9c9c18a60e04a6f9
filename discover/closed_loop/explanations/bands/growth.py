"""How much a law that leaves structure misses of flows faster than those that it was fitted to."""

import numpy as np
from jaxtyping import Float

_FEWEST = 3  # runs, the fastest twice as fast as the slowest, that tell how errors grow
_STEEPEST = 2.0  # power of the rate


def growth(
    errors: Float[np.ndarray, " fitted"],
    rates: Float[np.ndarray, " fitted"],
    others: Float[np.ndarray, " runs"],
) -> Float[np.ndarray, " runs"]:
    """Return by what factor relative errors of other runs are larger, at least 1.

    What is missing grows in the fitted runs with some power of the rate, found by linear regression
    of the logarithms, and is taken to go on so. Runs no faster than the fastest have a factor of 1.

    Parameters
    ----------
    rates, others
        Largest rates of these and of other runs in 1/s; zero where a run has none.
    """
    factor = np.ones(len(others))
    told = len(rates) >= _FEWEST and np.all(rates > 0.0) and np.all(errors > 0.0)
    if not told or np.max(rates) < 2.0 * np.min(rates):
        return factor
    power = float(np.clip(np.polyfit(np.log(rates), np.log(errors), 1)[0], 0.0, _STEEPEST))
    return np.maximum(others / np.max(rates), 1.0) ** power
