"""Runs that no fit saw, and what a model leaves of them."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from discover.closed_loop.judging.numerical_resolution import NumericalResolution
from discover.forward import AugmentedModel, Batch, Linearised, even
from discover.inference.fit_uncertainty import covariance_and_noise
from discover.inference.least_squares import Fit
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
    found = model.linearise(theta, resolution.batch, fit.free)
    rows = range(len(found.residual))
    unseen = unseen_rows((batch, fit), found, resolution.batch, rows)
    return HeldOut(found.residual, resolution, unseen)


def unseen_rows(
    fitted: tuple[Batch, Fit], found: Linearised, batch: Batch, rows: Iterable[int]
) -> Unseen:
    """Return what a model leaves of some runs that a fit did not see.

    Parameters
    ----------
    fitted
        The runs that were fitted, and the fit, which says how uncertain the constants are.
    found, batch
        What the parameters that predict leave of runs, with derivatives by what was fitted.
    rows
        Those of the runs that are asked about.
    """
    root, correlation = np.zeros((0, 0)), np.ones(1)
    if fitted[1].free:
        root, correlation = root_of_covariance(*fitted)
    columns = np.tensordot(root, found.jacobian, axes=(0, 0))
    weight, records = np.asarray(batch.weight), np.asarray(batch.recorded)
    kept = {i: weight[i] > 0 for i in rows}
    sizes = {i: even(weight[i, seen]) for i, seen in kept.items()}
    return Unseen(
        [found.residual[i, seen] / weight[i, seen] / sizes[i] for i, seen in kept.items()],
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
