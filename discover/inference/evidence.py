"""Evidence for effects: the information criterion, and what a difference of it is worth."""

import numpy as np
from jaxtyping import Float

from discover.inference.least_squares import Fit
from discover.statistics.residual import judged_cost

INDISTINGUISHABLE = 6.0
"""Below this difference of the criterion two effects are aliases   [Kass & Raftery 1995, JASA 90,
773: from 6 on the evidence is strong]."""


WINDOW = 20.0
"""An explanation so many times less probable than the best counts no longer: Occam's window
[Madigan & Raftery 1994, J. Am. Stat. Assoc. 89, 1535]."""


def evidence(
    before: Fit,
    after: Fit,
    weight: Float[np.ndarray, "runs n"],
    effective_samples: float,
    n_candidates: int,
    n_effects: int = 1,
) -> float:
    """Return by how much adding parameters lowers the information criterion.

    The Bayesian criterion on the number of independent samples that the remaining residual is
    worth, with a price for having chosen among `n_candidates`   [Schwarz 1978, Ann. Statist. 6,
    461; Chen & Chen 2008, Biometrika 95, 759 for the price].

    Parameters
    ----------
    before, after
        Fits without and with the effect.
    weight
        Weights of the runs; those that do not judge (`judging`) are fitted, but give no evidence.
    effective_samples
        One number for all candidates that are compared: counted on each one's own residual, the
        worst fit with the whitest residual could win.
    n_effects
        How many were chosen among them.
    """
    added = len(after.free) - len(before.free)
    cost, lowered = (judged_cost(fit.residual, weight) for fit in (before, after))
    if lowered <= 0.0:
        return float("inf") if cost > 0.0 else -float("inf")
    gain = effective_samples * np.log(cost / lowered) if cost > 0.0 else -np.inf
    return float(gain - price(added, n_effects, effective_samples, n_candidates))


def price(constants: int, n_effects: int, effective_samples: float, n_candidates: int) -> float:
    """Return what constants, and having chosen effects among candidates, cost in the criterion.

    Parameters
    ----------
    constants, n_effects
        How many are added.
    effective_samples, n_candidates
        As in `evidence`.
    """
    chosen = 2.0 * n_effects * np.log(max(n_candidates, 1))
    return float(constants * np.log(max(effective_samples, 2.0)) + chosen)


def criterion(
    cost: float, constants: int, n_effects: int, effective_samples: float, n_candidates: int
) -> float:
    """Return the information criterion of a whole set of effects: small for a probable one.

    Of two sets the difference is the `evidence` for one over the other.

    Parameters
    ----------
    cost
        Sum over the runs that judge of the squared relative errors (`judged_cost`).
    constants, n_effects
        How many are in it.
    effective_samples, n_candidates
        As in `evidence`.
    """
    misfit = effective_samples * np.log(max(cost, np.finfo(float).tiny))
    return float(misfit + price(constants, n_effects, effective_samples, n_candidates))
