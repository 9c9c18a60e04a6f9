"""Where one more would lie of kinds of which a few are known."""

import numpy as np
from jaxtyping import Float, Int
from scipy.special import stdtrit

_TAIL = 0.975


def one_more(
    values: Float[np.ndarray, "n ..."], kinds: Int[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, "..."], Float[np.ndarray, "..."]]:
    """Return the ends of the 95 % prediction interval of a value of one more kind.

    Kinds are taken for a sample of a normal distribution, values of a kind for one about its mean:
    m ± t √(B (1 + 1/K) + W), with B the variance between K kinds, W that within, and t of K − 1
    degrees of freedom   [Hahn & Meeker 1991, Statistical Intervals, sect. 4.7; Higgins, Thompson &
    Spiegelhalter 2009, J. R. Stat. Soc. A 172, 137, for what scatters within].

    Parameters
    ----------
    values
        One row for each of n members.
    kinds
        Number of the kind of each; at least two kinds.
    """
    rows = [values[kinds == kind] for kind in np.unique(kinds)]
    means = np.stack([np.mean(row, axis=0) for row in rows])
    within = np.mean([np.var(row, axis=0) for row in rows], axis=0)
    between = np.var(means, axis=0, ddof=1) * (1.0 + 1.0 / len(rows))
    half = float(stdtrit(len(rows) - 1, _TAIL)) * np.sqrt(between + within)
    middle = np.mean(means, axis=0)
    return middle - half, middle + half
