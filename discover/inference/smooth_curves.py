"""Smooth curves along the samples of a run, or after each step of its rate, as sums of cosines."""

import numpy as np
from jaxtyping import Float
from scipy.ndimage import uniform_filter1d

from discover.inference.rows import Rows

MODES = 20
"""Cosines of a curve."""

_AFTER_A_STEP = 10.0
"""Samples of a run over those that the logarithm leaves as they are."""

_ALONE = 3
"""Samples over which a transient is taken: one that is off alone is a knock, and no transient."""

_STEP = 0.3
"""Of the largest rate, by which it changes from one sample to the next where it steps."""


def half_of(after_a_step: bool) -> slice:
    """Return which of all curves run along the samples, or after the steps of the rate."""
    return slice(MODES, None) if after_a_step else slice(MODES)


def spectrum_of(stiffness: float) -> Float[np.ndarray, " k"]:
    """Return the deviations of cosines whose sum has a root mean square of one."""
    k = np.arange(MODES)
    power = 1.0 / (1.0 + (k / stiffness) ** 4)
    # a cosine has half of the square of its size, a constant all of it
    return power / np.sqrt(np.sum(power**2 * np.where(k == 0, 1.0, 0.5)))


def cosines(rows: Rows) -> Float[np.ndarray, "rows curves"]:
    """Return cosines along the samples of the run of each row, and after its steps."""
    out = np.zeros((len(rows), 2 * MODES))
    for i, run in enumerate(rows.runs):
        n, rate = len(run), np.asarray(run.rate, float)
        steps = np.abs(np.diff(rate, prepend=rate[0])) > _STEP * rows.fastest[i]
        since = np.arange(n) - np.maximum.accumulate(np.where(steps, np.arange(n), 0)) + 0.5
        after = np.log1p(_AFTER_A_STEP * since / n) / np.log1p(_AFTER_A_STEP)
        along, afterwards = (
            np.cos(np.pi * np.outer(x, np.arange(MODES))) for x in ((np.arange(n) + 0.5) / n, after)
        )
        afterwards = uniform_filter1d(afterwards, _ALONE, axis=0)
        out[rows.run == i] = np.column_stack([along, afterwards])
    return out
