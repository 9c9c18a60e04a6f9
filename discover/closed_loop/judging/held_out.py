"""Runs that no fit saw, and what a model leaves of them."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from discover.closed_loop.judging.numerical_resolution import NumericalResolution
from discover.forward import AugmentedModel, Batch, even
from discover.inference.fit_uncertainty import covariance_and_noise
from discover.inference.least_squares import Fit, jacobians
from discover.statistics import root_of
from discover.statistics.unseen import Unseen


@dataclass(frozen=True)
class HeldOut:
    """Runs that no fit saw: what the final model leaves of them, and what arithmetic leaves.

    Attributes
    ----------
    residual
        Weighted residuals, padded, shape (runs, n).
    resolution
        Of these runs.
    unseen
        The residuals in Pa, with what uncertain constants may change in them.
    """

    residual: Float[np.ndarray, "runs n"]
    resolution: NumericalResolution
    unseen: Unseen

    @property
    def weight(self) -> Float[np.ndarray, "runs n"]:
        """Weights of the runs, zero at padding."""
        return np.asarray(self.resolution.batch.weight)


def held_out(
    model: AugmentedModel,
    batch: Batch,
    fit: Fit,
    theta: np.ndarray,
    resolution: NumericalResolution,
) -> HeldOut:
    """Return what a final model leaves of runs that no fit saw."""
    residual = model.residuals([theta], resolution.batch)
    rows = range(len(residual[0]))
    unseen = unseen_rows(model, (batch, fit), theta, resolution.batch, residual, rows)
    return HeldOut(residual[0], resolution, unseen)


def unseen_rows(
    model: AugmentedModel,
    fitted: tuple[Batch, Fit],
    theta: np.ndarray,
    batch: Batch,
    residual: Float[np.ndarray, "1 runs n"],
    rows: Iterable[int],
) -> Unseen:
    """Return what a model leaves of some runs that a fit did not see.

    Parameters
    ----------
    model
        The model.
    fitted
        The runs that were fitted, and the fit, which says how uncertain the constants are.
    theta
        The parameters that predict.
    batch, residual
        Runs, and what these parameters leave of them.
    rows
        Those of the runs that are asked about.
    """
    derivative = np.zeros((0, *residual[0].shape))
    root, correlation = np.zeros((0, 0)), np.ones(1)
    if fitted[1].free:
        derivative = jacobians(model, batch, [theta], residual, [fitted[1].free])[0]
        root, correlation = root_of_covariance(*fitted)
    columns = np.tensordot(root, derivative, axes=(0, 0))
    weight, records = np.asarray(batch.weight), np.asarray(batch.recorded)
    kept = {i: weight[i] > 0 for i in rows}
    sizes = {i: even(weight[i, seen]) for i, seen in kept.items()}
    return Unseen(
        [residual[0, i, seen] / weight[i, seen] / sizes[i] for i, seen in kept.items()],
        [records[i, seen] / sizes[i] for i, seen in kept.items()],
        [columns[:, i, seen] / weight[i, seen] / sizes[i] for i, seen in kept.items()],
        correlation,
    )


def root_of_covariance(batch: Batch, fit: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Return a root of the constants' covariance, shape (free, free), and the noise's correlation.

    A column is a combination of the constants that varies by one standard deviation.
    """
    covariance, noise = covariance_and_noise(batch, fit.residual, fit.jacobian)
    if not np.all(np.isfinite(covariance)):
        return np.zeros_like(covariance), noise.correlation
    return root_of(covariance), noise.correlation
