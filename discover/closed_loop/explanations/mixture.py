"""What several explanations predict together, as a band."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy.special import ndtr, ndtri
from scipy.stats import t as student

from discover.closed_loop.explanations.beam import Carried
from discover.closed_loop.explanations.discrepancy import discrepancy
from discover.closed_loop.held_out import uncertainty
from discover.forward import AugmentedModel, Batch
from discover.forward.least_squares import jacobians

_HALVINGS = 40
_TAILS = (0.025, 0.975)


def mixed_band(
    model: AugmentedModel,
    fitted: Batch,
    carried: Sequence[Carried],
    probabilities: Sequence[float],
    batch: Batch,
    noise: float,
    structured: bool,
    candidates: Sequence[str],
) -> Float[np.ndarray, "2 runs n"]:
    """Return where 95 % of the measurements should lie, were it one of the explanations.

    Each explanation gives a normal distribution about its prediction, as wide as its constants are
    uncertain and as what it leaves of the fitted runs; they are mixed by their probabilities.

    Parameters
    ----------
    model, fitted
        The model, and the runs that were fitted.
    carried, probabilities
        The explanations, and how probable each is.
    batch
        The runs to predict.
    noise
        Relative noise of a measurement.
    structured
        Whether what they leave of the fitted runs is more than noise. A run shares it, so that as
        many runs say how large it is in another one, and the tails are Student's.
    candidates
        Effects that an explanation may still lack; see `discrepancy`.

    Returns
    -------
    The lower and the upper limit, in the unit of the record; zero at padding.
    """
    weight, recorded = np.asarray(batch.weight), np.asarray(batch.recorded)
    seen = weight > 0
    scale = np.where(seen, weight, 1.0)
    share = np.asarray(probabilities) / np.sum(probabilities)
    samples = np.maximum(np.count_nonzero(seen, axis=1), 1)
    size = np.sqrt(np.sum(np.where(seen, recorded, 0.0) ** 2, axis=1) / samples)[:, None]
    tails = student.ppf(_TAILS[1], len(fitted.weight)) / ndtri(_TAILS[1]) if structured else 1.0
    means, deviations, shares = [], [], []
    for one, part in zip(carried, share, strict=True):
        residual = model.residuals([one.fit.theta], batch)
        if not np.all(np.isfinite(residual)):
            continue
        variance = np.zeros_like(weight)
        if one.fit.free:
            slope = jacobians(model, batch, [one.fit.theta], residual, [one.fit.free])[0] / scale
            root, _ = uncertainty(fitted, one.fit)
            columns = np.tensordot(root, np.where(np.isfinite(slope), slope, 0.0), axes=(0, 0))
            variance = np.sum(columns**2, axis=0)
        others = [name for name in candidates if name not in one.effects]
        variance += discrepancy(model, fitted, one.fit, others, batch) / scale**2
        left = max(noise, float(np.sqrt(np.mean(one.fit.run_errors**2)))) * tails
        means.append(np.where(seen, residual[0] / scale + recorded, 0.0))
        deviations.append(np.sqrt(variance + (left * size) ** 2))
        shares.append(part)
    if not means:
        return np.full((2, *weight.shape), np.nan)
    mean, deviation = np.array(means), np.maximum(np.array(deviations), np.finfo(float).tiny)
    part = np.array(shares)[:, None, None] / np.sum(shares)
    return np.where(seen, np.array([quantile(mean, deviation, part, p) for p in _TAILS]), 0.0)


def quantile(mean, deviation, share, level: float) -> Float[np.ndarray, "runs n"]:
    """Return a quantile of mixed normal distributions, by halving an interval that holds it."""
    low = np.min(mean - 8.0 * deviation, axis=0)
    high = np.max(mean + 8.0 * deviation, axis=0)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        below = np.sum(share * ndtr((middle - mean) / deviation), axis=0) < level
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return 0.5 * (low + high)
