"""What of a residual is noise: that which changes from sample to sample.

Rows are residuals of runs over the root mean square of each record.
"""

from math import comb

import numpy as np
from jaxtyping import Float

from discover.statistics.noise.noise_model import Rows
from discover.statistics.noise.whiteness import FEWEST_FAST


def fast_part(values: Float[np.ndarray, " n"]) -> float:
    """Return the standard deviation of what changes from sample to sample.

    From the median of third differences, which smooth sequences and a few jumps hardly change
    [Gasser, Sroka & Jennen-Steinmetz 1986, Biometrika 73, 625]. Zero for fewer than `FEWEST_FAST`.
    """
    if len(values) < FEWEST_FAST:
        return 0.0
    return float(1.4826 * np.median(np.abs(np.diff(values, 3))) / np.sqrt(comb(6, 3)))


def noise_beside(rows: Rows, sizes: Float[np.ndarray, " runs"]) -> Float[np.ndarray, " runs"]:
    """Return the noise of runs in a residual that is more than noise: what of it is fast.

    `sizes`: the most it may be, as that of a run too short to tell is.
    """
    told = [len(row) >= FEWEST_FAST for row in rows]
    return np.where(told, np.minimum([fast_part(row) for row in rows], sizes), sizes)
