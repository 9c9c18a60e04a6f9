"""What the runs say of the constant of one mode, were nothing else fitted."""

import numpy as np
from jaxtyping import Bool, Float

from discover.forward import AugmentedModel, Batch
from discover.forward.by_mode import DEGREE
from discover.inference.fit_uncertainty import uncertainty
from discover.inference.least_squares import Fit

_OPEN = float(np.log(0.95 / 0.05))
"""Half width of an interval, on the link's scale, from which on nothing is determined: about the
middle of a range it holds nine tenths of it, about a small constant a factor of 19 either way."""


def half_widths_alone(
    model: AugmentedModel, batch: Batch, fit: Fit, name: str
) -> Float[np.ndarray, " k"]:
    """Return half the interval of each mode's constant, were nothing else fitted.

    On the link's scale. No other question of one mode alone is easier for the data, so that what
    is open here is open indeed.

    Parameters
    ----------
    model, batch, fit
        The model, the fitted runs and the fit.
    name
        Of the constant by mode.
    """
    at = model.varying(name)[DEGREE:]
    columns = model.linearise(fit.theta, batch, at).jacobian
    half = np.full(len(columns), np.inf)
    for i, column in enumerate(columns):
        if np.any(column) and np.all(np.isfinite(column)):
            variance, quantile = uncertainty(batch, fit.residual, column[None])
            half[i] = quantile * float(np.sqrt(variance[0, 0]))
    return half


def is_told(half: Float[np.ndarray, " k"]) -> Bool[np.ndarray, " k"]:
    """Return where half of an interval on the link's scale tells a constant."""
    return half < _OPEN


def told_beyond_a_polynomial(
    model: AugmentedModel, batch: Batch, fit: Fit, name: str
) -> tuple[int, ...]:
    """Return which of the modes that the runs tell by themselves no polynomial need follow.

    One of the highest degree passes through three of them: the fastest, the slowest and the one in
    their middle.

    Parameters
    ----------
    model, batch, fit, name
        As in `half_widths_alone`.
    """
    told = np.flatnonzero(is_told(half_widths_alone(model, batch, fit, name)))
    if len(told) <= DEGREE + 1:
        return ()
    order = told[np.argsort(model.mode_times(fit.theta)[told])]
    held = {int(order[0]), int(order[len(order) // 2]), int(order[-1])}
    return tuple(int(mode) for mode in told if int(mode) not in held)
