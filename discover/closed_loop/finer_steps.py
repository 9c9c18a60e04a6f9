"""What an element in series with the fluid would be on finer steps."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from discover.closed_loop.augmented_model import AugmentedModel
from discover.closed_loop.least_squares import Fit
from discover.closed_loop.run_batch import RunBatch, make_batch
from discover.dataset import ShearRun
from discover.effects import SeriesElement

_STRAIN_STEP = 0.05


def on_finer_steps(
    model: AugmentedModel,
    batch: RunBatch,
    runs: Sequence[ShearRun],
    fit: Fit,
    active: Sequence[str],
) -> Fit:
    """Return a fit with its parameters moved to where finer steps would put them.

    What a series element takes is found to second order in the step, the stress to fourth. On the
    steps of a search that is an error of a thousandth of the stress: nothing to a law, but more
    than the noise to the compliance itself. One prediction on steps a fifth as long says how the
    residual would change, and one Gauss–Newton step what that does to the parameters. Fits without
    such an element are returned as they are.

    Parameters
    ----------
    model, batch, runs
        The model, and the fitted runs as a batch and as they are.
    fit, active
        The fit and the effects in it.
    """
    effects = [effect for effect in model.effects if effect.name in active]
    if not any(isinstance(effect, SeriesElement) for effect in effects):
        return fit
    # without the candidates that were not chosen there is little to compile
    small = AugmentedModel(model.declared, effects)
    theta = small.zero()
    shared = 2 + len(model.declared.free_parameters)
    theta[:shared] = fit.theta[:shared]
    for effect in effects:
        theta[small.positions(effect.name)] = fit.theta[model.positions(effect.name)]
    coarse = small.residuals([theta], batch)[0]
    fine = small.residuals([theta], make_batch(runs, strain_step=_STRAIN_STEP))[0]
    design = fit.jacobian.reshape(len(fit.free), -1).T
    step = np.linalg.lstsq(design, (coarse - fine).ravel(), rcond=None)[0]
    moved, at = fit.theta.copy(), list(fit.free)
    moved[at] = np.clip(moved[at] + step, model.low[at], model.high[at])
    return replace(fit, theta=moved) if np.all(np.isfinite(moved)) else fit
