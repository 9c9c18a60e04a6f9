"""One damped step of least squares, the best that the ranges of the parameters hold."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy.optimize import lsq_linear

from discover.forward import AugmentedModel
from discover.inference.least_squares.fit import Prior


def room_of(
    model: AugmentedModel, theta: Float[np.ndarray, " p"], positions: Sequence[int]
) -> Float[np.ndarray, "2 positions"]:
    """Return how far parameters may go, down (none of it positive) and up."""
    at = list(positions)
    return np.stack([model.low[at] - theta[at], model.high[at] - theta[at]])


def stepped(
    model: AugmentedModel,
    theta: Float[np.ndarray, " p"],
    free: Sequence[int],
    residual: Float[np.ndarray, "runs n"],
    jacobian: Float[np.ndarray, "free runs n"],
    damping: float,
    prior: Prior,
) -> Float[np.ndarray, " p"]:
    """Return parameters after the best step that their ranges hold, of those that are free."""
    at, moved = list(free), theta.copy()
    known, room = prior.rows(theta, at), room_of(model, theta, at)
    step = gauss_newton_step(jacobian, residual, damping, known, room)
    moved[at] = np.clip(theta[at] + step, model.low[at], model.high[at])
    return moved


def gauss_newton_step(jacobian, residual, damping, known=None, room=None):
    """Return the damped step of the free parameters, with rows of what is known of them.

    Of those that lead no further down and up than `room` allows, if that is given; see `room_of`.
    """
    if len(jacobian) == 0:
        return np.zeros(0)
    design = jacobian.reshape(len(jacobian), -1).T
    if not np.all(np.isfinite(design)):
        return np.zeros(len(jacobian))
    residual = residual.ravel()
    if known is not None and len(known[0]):
        residual = np.concatenate([residual, known[0]])
        design = np.concatenate([design, known[1]])
    scale = np.linalg.norm(design, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    scaled = design / scale
    padded = np.concatenate([scaled, np.sqrt(damping) * np.eye(len(jacobian))])
    target = np.concatenate([-residual, np.zeros(len(jacobian))])
    step = np.linalg.lstsq(padded, target, rcond=None)[0]
    if room is not None:
        low, high = (scale * bound for bound in room)
        if np.any((step < low) | (step > high)):
            high = np.maximum(high, np.nextafter(low, np.inf))  # a range may be one value
            step = lsq_linear(padded, target, (low, high), method="bvls").x
    return step / scale
