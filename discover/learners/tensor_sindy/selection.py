"""Which member of a path of laws to believe: by evidence, or by runs left out."""

import numpy as np
from jaxtyping import Float
from scipy.stats import t as student

from discover.learners.settings import ARITHMETIC

_LEVEL = 0.01


def choose_by_held_out(errors: Float[np.ndarray, "path runs"]) -> int:
    """Return the simplest member whose error in runs left out cannot be told from the best one's.

    `errors`: relative misfit of each member in each run that its fit did not see.

    Notes
    -----
    Simpler than the best is preferred unless a paired t-test on the logarithms of the errors, run
    by run, rejects it at 1 %. The supports were found with all runs in view, so that the error of
    too large a member is somewhat flattered: the strict level answers that.
    """
    floored = np.log(_floored(errors))
    best = int(np.argmin(np.mean(floored, axis=1)))
    count = errors.shape[1]
    for member in range(best):
        excess = floored[member] - floored[best]
        spread = float(np.std(excess, ddof=1)) / np.sqrt(count)
        if np.mean(excess) <= student.ppf(1.0 - _LEVEL, count - 1) * spread:
            return member
    return best


def choose_by_one_standard_error(errors: Float[np.ndarray, "path runs"]) -> int:
    """Return the simplest member within one standard error of the best in runs left out.

    The rule of one standard error   [Breiman et al. 1984, Classification and Regression Trees,
    ch. 3.4.3]: the mean over runs of the squared error is no larger than the best one's plus the
    standard error of that mean. What is left out is a whole run, so that the correlation of
    neighbouring samples does not pass for independent evidence.
    """
    squares = _floored(errors) ** 2
    means = np.mean(squares, axis=1)
    best = int(np.argmin(means))
    error = float(np.std(squares[best], ddof=1)) / np.sqrt(errors.shape[1])
    return int(np.flatnonzero(means <= means[best] + error)[0])


def _floored(errors: Float[np.ndarray, "path runs"]) -> Float[np.ndarray, "path runs"]:
    return np.maximum(np.where(np.isfinite(errors), errors, 1.0), ARITHMETIC)
