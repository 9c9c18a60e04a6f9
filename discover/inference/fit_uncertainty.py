"""How far the parameters of a fit may be off: from its curvature and the noise that it leaves."""

import numpy as np
from jaxtyping import Float
from scipy.stats import t as student

from discover.forward.augmented_model import AugmentedModel
from discover.forward.batches import Batch
from discover.inference.least_squares import Fit
from discover.inference.modulus_errors import response
from discover.statistics import NoiseModel, least_squares_covariance


def intervals(
    model: AugmentedModel,
    batch: Batch,
    fit: Fit,
    shifts: Float[np.ndarray, "k runs n"] | None = None,
) -> dict[int, tuple[float, float]]:
    """Return the 95 % interval of each fitted parameter, by position.

    From the curvature at the fit and the noise that its residual shows; see
    `discover.statistics.least_squares_covariance`.

    Parameters
    ----------
    model, batch, fit
        The model, the fitted runs and the fit.
    shifts
        What errors of the moduli change (`modulus_shifts`); None takes the moduli for exact.
    """
    if not fit.free:
        return {}
    covariance, quantile = uncertainty(batch, fit.residual, fit.jacobian)
    covariance = with_moduli(covariance, fit, shifts)
    half = quantile * np.sqrt(np.clip(np.diag(covariance), 0.0, None))
    bounds = {}
    for position, h in zip(fit.free, half, strict=True):
        value, low, high = fit.theta[position], model.low[position], model.high[position]
        # a time must be positive, and what may be as short as that may be nothing
        floor = 0.0 if 0.0 < low < 1e-6 * value else low
        bounds[position] = (
            float(floor if value - h < low else value - h),
            float(min(value + h, high)),
        )
    return bounds


def with_moduli(
    covariance: Float[np.ndarray, "free free"],
    fit: Fit,
    shifts: Float[np.ndarray, "k runs n"] | None,
) -> Float[np.ndarray, "free free"]:
    """Return the covariance of fitted parameters with that of the moduli in it; see `intervals`."""
    if shifts is None or not len(shifts):
        return covariance
    off = response(fit.jacobian, shifts)
    return covariance + off @ off.T


def uncertainty(
    batch: Batch, residual: Float[np.ndarray, "runs n"], jacobian: Float[np.ndarray, "free runs n"]
) -> tuple[Float[np.ndarray, "free free"], float]:
    """Return the covariance of fitted parameters, and how many deviations hold 95 %."""
    covariance, noise = covariance_and_noise(batch, residual, jacobian)
    independent = max(noise.effective_samples - len(jacobian), 1.0)
    return covariance, float(student.ppf(0.975, independent))


def covariance_and_noise(
    batch: Batch, residual: Float[np.ndarray, "runs n"], jacobian: Float[np.ndarray, "free runs n"]
) -> tuple[Float[np.ndarray, "free free"], NoiseModel]:
    """Return the covariance of fitted parameters, and the noise that it rests on."""
    design = jacobian.reshape(len(jacobian), -1).T
    # a run that was left out of the fit says nothing of the noise
    told = [(rows, size) for rows, size in zip(*sequences_of(batch), strict=True) if len(rows)]
    sequences, sizes = zip(*told, strict=True)
    covariance, _, noise = least_squares_covariance(
        design, residual.ravel(), sequences, sizes=sizes
    )
    return covariance, noise


def sequences_of(batch: Batch) -> tuple[list[np.ndarray], list[float]]:
    """Return the rows of each run in a flattened residual, and the size of noise alike in all.

    Every run has a weight of one in all, however many samples share it; so where records are
    equally noisy, residuals of a long run are the smaller ones.
    """
    seen = np.asarray(batch.weight) > 0
    rows = np.arange(seen.size).reshape(seen.shape)
    sequences = [row[kept] for row, kept in zip(rows, seen, strict=True)]
    return sequences, [1.0 / np.sqrt(max(len(own), 1)) for own in sequences]
