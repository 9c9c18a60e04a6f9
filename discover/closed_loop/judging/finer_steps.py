"""What finer steps would change: in a prediction, and in the parameters of a fit."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from discover.dataset import Run
from discover.effects import AbstractEffect, SeriesElement
from discover.errors import InputError
from discover.forward import AugmentedModel, Batch, make_batch
from discover.inference.least_squares import Fit
from discover.protocols import another_between_samples

_STRAIN_STEP = 0.05


def on_finer_steps(
    model: AugmentedModel,
    batch: Batch,
    runs: Sequence[Run],
    fit: Fit,
    active: Sequence[str],
) -> Fit:
    """Return a fit with its parameters moved to where finer steps would put them.

    What a series element takes is found to second order in the step, the stress to fourth. On the
    steps of a search that is an error of a thousandth of the stress: nothing to a law, but more
    than the noise to the compliance itself. One prediction on steps a fifth as long says how the
    residual would change, and one Gauss–Newton step what that does to the parameters. Fits without
    such an element are returned as they are.
    """
    effects = _in_use(model, active)
    if not any(isinstance(effect, SeriesElement) for effect in effects):
        return fit
    change = change_on_finer_steps(model, batch, runs, fit.theta, active)
    step, _ = constants_that_follow(fit, change)
    moved, at = fit.theta.copy(), list(fit.free)
    moved[at] = np.clip(moved[at] + step, model.low[at], model.high[at])
    return replace(fit, theta=moved) if np.all(np.isfinite(moved)) else fit


def constants_that_follow(
    fit: Fit, change: Float[np.ndarray, "runs n"]
) -> tuple[Float[np.ndarray, " free"], Float[np.ndarray, "runs n"]]:
    """Return how a change of the residuals moves the fitted constants, and what is left of it.

    One Gauss–Newton step.
    """
    if not fit.free:
        return np.zeros(0), change
    design = fit.jacobian.reshape(len(fit.free), -1).T
    step = np.linalg.lstsq(design, -change.ravel(), rcond=None)[0]
    return step, (change.ravel() + design @ step).reshape(change.shape)


def change_on_finer_steps(
    model: AugmentedModel,
    batch: Batch,
    runs: Sequence[Run],
    theta: np.ndarray,
    active: Sequence[str],
    other_rates: bool = False,
    strain_step: float = _STRAIN_STEP,
) -> Float[np.ndarray, "runs n"]:
    """Return how weighted residuals would change on steps a fifth as long.

    Parameters
    ----------
    model, batch, runs
        The model, and the runs as a batch and as they are.
    theta, active
        Parameters, and the effects among them that are in the model.
    other_rates
        Whether a rate that was read in samples is another curve through them on the finer steps
        (`another_between_samples`): what that changes is what nobody knows of the rate.
    strain_step
        Largest strain of one of the finer steps.

    Returns
    -------
    Zero where finer steps would be too many, or would not stay finite.
    """
    # without the candidates that were not chosen there is little to compile
    effects = _in_use(model, active)
    small = AugmentedModel(model.declared, effects)
    values = small.zero()
    shared = model.declared.size
    values[:shared] = theta[:shared]
    values[small.instants] = theta[model.instants]
    for effect in effects:
        values[small.positions(effect.name)] = theta[model.positions(effect.name)]
    finer = [_with_another_rate(run) for run in runs] if other_rates else runs
    try:
        fine_batch = make_batch(finer, strain_step=strain_step)
    except InputError:
        return np.zeros(np.shape(batch.recorded))
    change = small.residuals([values], fine_batch)[0] - small.residuals([values], batch)[0]
    return change if np.all(np.isfinite(change)) else np.zeros_like(change)


def _in_use(model: AugmentedModel, active: Sequence[str]) -> list[AbstractEffect]:
    names = {*active, *(known.name for known in model.declared.effects)}
    return [effect for effect in model.effects if effect.name in names]


def _with_another_rate(run: Run) -> Run:
    """Return a run whose rate, where it was read in samples, is another curve through them."""
    smooth = another_between_samples(run.protocol, run.time)
    return run if smooth is None else replace(run, protocol=smooth)
