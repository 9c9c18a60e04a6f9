"""What data tell of two constants that they leave open: their product, or their ratio."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from discover.forward import Batch
from discover.inference.fit_uncertainty import uncertainty
from discover.inference.least_squares import Fit

_FAR = np.log(10.0)
"""How far both go, in logarithms, for what they have in common to be worth a word."""

_NEAR = np.log(1.25)
"""How far a product or a ratio of them may go meanwhile, to be told."""


def product_or_ratio(
    batch: Batch,
    fit: Fit,
    possible: Sequence[Float[np.ndarray, " p"]],
    first: int,
    second: int,
) -> tuple[bool, float, tuple[float, float]] | None:
    """Return what hardly changes where two constants go far; None if nothing is so.

    Returns
    -------
    Whether it is the ratio, first over second, and not the product; its value; its 95 % interval,
    over all possible constants and as wide at each as noise makes it.
    """
    pairs = np.array([[theta[first], theta[second]] for theta in (fit.theta, *possible)])
    if np.any(pairs <= 0.0) or first not in fit.free or second not in fit.free:
        return None
    logarithms = np.log(pairs)
    if np.min(np.ptp(logarithms, axis=0)) < _FAR:
        return None
    combined = logarithms @ np.array([[1.0, 1.0], [1.0, -1.0]]).T
    chosen = int(np.argmin(np.ptp(combined, axis=0)))
    along = combined[:, chosen]
    if np.ptp(along) > _NEAR:
        return None
    half = _half_width(batch, fit, first, second)
    ends = float(np.exp(np.min(along) - half)), float(np.exp(np.max(along) + half))
    return bool(chosen), float(np.exp(along[0])), ends


def _half_width(batch: Batch, fit: Fit, first: int, second: int) -> float:
    """Return half the interval of the logarithm, the place along the valley being given."""
    at = fit.free.index(first)
    jacobian = fit.jacobian.copy()
    jacobian[at] *= fit.theta[first]
    kept = [i for i in range(len(fit.free)) if i != fit.free.index(second)]
    covariance, quantile = uncertainty(batch, fit.residual, jacobian[kept])
    own = kept.index(at)
    return quantile * float(np.sqrt(covariance[own, own]))
