"""Which member of a support path to believe."""

from math import lgamma, log

import numpy as np
from jaxtyping import Float
from scipy.stats import t as student

_LEVEL = 0.01


def extended_bic(
    misfit: float, n_observations: float | int, n_terms: int, n_inner: int, library_size: int
) -> float:
    """Return the extended Bayesian information criterion   [Chen & Chen 2008, Biometrika 95, 759].

    n ln(misfit²) + k ln n + 2 ln C(p, terms). The last part is the price of having looked at many
    supports: with p candidates the best useless one looks better than a single useless one would,
    and plain BIC lets it in.

    Parameters
    ----------
    misfit
        Relative root-mean-square misfit, floored by the caller where data have no noise.
    n_observations
        n: of observations in correlated noise, how many independent ones they are worth.
    n_terms, n_inner
        Coefficients and inner parameters fitted; k is their sum.
    library_size
        p.
    """
    supports = lgamma(library_size + 1) - lgamma(n_terms + 1) - lgamma(library_size - n_terms + 1)
    return (
        2.0 * n_observations * log(misfit)
        + (n_terms + n_inner) * log(n_observations)
        + 2.0 * supports
    )


def choose_by_bic(criterion: Float[np.ndarray, " path"]) -> int:
    """Return the position of the smallest criterion; of equals, the first and so the simplest."""
    return int(np.argmin(criterion))


def choose_by_held_out(errors: Float[np.ndarray, "path folds"], floor: float) -> int:
    """Return the simplest member whose held-out misfit cannot be told from the best one's.

    Parameters
    ----------
    errors
        Relative misfit of each member on each group of runs that its refit did not see.
    floor
        Misfits below it count as equal.

    Notes
    -----
    Simpler than the best is preferred unless a paired t-test on the logarithms of the misfits, fold
    by fold, rejects it at 1 %. The supports were found with all runs in view, so that the held-out
    misfit of too large a member is somewhat flattered: the strict level answers that.
    """
    floored = np.log(np.maximum(np.where(np.isfinite(errors), errors, 1e3), floor))
    best = int(np.argmin(np.mean(floored, axis=1)))
    n_folds = errors.shape[1]
    for member in range(best):
        excess = floored[member] - floored[best]
        spread = float(np.std(excess, ddof=1)) / np.sqrt(n_folds)
        if np.mean(excess) <= student.ppf(1.0 - _LEVEL, n_folds - 1) * spread:
            return member
    return best


def choose_by_one_standard_error(errors: Float[np.ndarray, "path folds"], floor: float) -> int:
    """Return the simplest member within one standard error of the best on runs left out.

    The rule of one standard error   [Breiman et al. 1984, Classification and Regression Trees,
    ch. 3.4.3]: the mean over folds of the squared misfit is no larger than the best one's plus the
    standard error of that mean over the folds. Folds are whole runs, so that the correlation of
    neighbouring samples does not pass for independent evidence.

    Parameters
    ----------
    errors
        Relative misfit of each member on each group of runs that its refit did not see.
    floor
        Misfits below it count as equal.
    """
    squares = np.maximum(np.where(np.isfinite(errors), errors, 1e3), floor) ** 2
    means = np.mean(squares, axis=1)
    best = int(np.argmin(means))
    error = float(np.std(squares[best], ddof=1)) / np.sqrt(errors.shape[1])
    return int(np.flatnonzero(means <= means[best] + error)[0])
