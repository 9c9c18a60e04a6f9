"""What a fit leaves, and how far its parameters may be off: by curvature, noise and moduli."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from discover.dataset import Run
from discover.forward.augmented_model import AugmentedModel
from discover.forward.flows import Batch
from discover.inference.least_squares import Fit
from discover.protocols.between_samples import sampling_interval
from discover.statistics import (
    LackOfFit,
    NoiseModel,
    lack_of_fit,
    least_squares_covariance,
    root_of,
)
from discover.statistics.residual import Expectation

_SHIFT = 0.1
"""Standard deviations by which moduli are moved; what a rate controls is linear in them."""


def uncertainty(
    model: AugmentedModel, batch: Batch, fit: Fit
) -> tuple[Float[np.ndarray, "free free"], float]:
    """Return covariance and degrees of freedom of a fit, errors of the moduli included.

    From the curvature at the fit and the noise that its residual shows; see
    `discover.statistics.least_squares_covariance`.
    """
    if not fit.free:
        return np.zeros((0, 0)), 1.0
    covariance, noise = _covariance_and_noise(batch, fit.residual, fit.jacobian)
    shifts = modulus_shifts(model, fit.theta, batch)
    if len(shifts):
        off = _response(fit.jacobian, shifts)
        covariance = covariance + off @ off.T
    return covariance, max(noise.effective_samples - len(fit.free), 1.0)


def what_is_left(
    fit: Fit, batch: Batch, runs: Sequence[Run], expectation: Expectation
) -> LackOfFit:
    """Return whether what a fit leaves of the runs is noise.

    `fit`, `batch`, `runs`: the fit, and the runs of the batch in its order. `expectation`: what a
    complete law may leave.
    """
    rows = zip(fit.residual, np.asarray(batch.weight), strict=True)
    residuals = [row[weight > 0] / weight[weight > 0] for row, weight in rows]
    even = [1.0 / run.sizes(run.recorded) for run in runs]
    intervals = [sampling_interval(run.time, run.protocol, run.quantity) for run in runs]
    records = [run.recorded for run in runs]
    return lack_of_fit(residuals, records, expectation, None, even, intervals)


def modulus_shifts(
    model: AugmentedModel, theta: Float[np.ndarray, " p"], batch: Batch
) -> Float[np.ndarray, "k runs n"]:
    """Return the change of the weighted residuals with each independent error of the moduli.

    Of the solvent too, where the sweep has one. An error of each has unit variance. Empty where the
    moduli are exact.
    """
    declared = model.declared
    if declared.modulus_covariance is None:
        return np.zeros((0, *np.shape(batch.weight)))

    # the solvent has no row where the moduli alone were told by the sweep
    moves = _SHIFT * root_of(declared.modulus_covariance).T
    moves = np.pad(moves, [(0, 0), (0, len(model.moduli) - moves.shape[1])])
    return np.nan_to_num(model.linearise(theta, batch, moves=moves).jacobian) / _SHIFT


def _response(
    jacobian: Float[np.ndarray, "free runs n"], shifts: Float[np.ndarray, "k runs n"]
) -> Float[np.ndarray, "free k"]:
    """Return by how much fitted parameters come out wrong with each error of the moduli."""
    design = jacobian.reshape(len(jacobian), -1).T
    scale = np.linalg.norm(design, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    target = shifts.reshape(len(shifts), -1).T
    return np.linalg.lstsq(design / scale, target, rcond=None)[0] / scale[:, None]


def _covariance_and_noise(
    batch: Batch, residual: Float[np.ndarray, "runs n"], jacobian: Float[np.ndarray, "free runs n"]
) -> tuple[Float[np.ndarray, "free free"], NoiseModel]:
    """Return the covariance of fitted parameters, and the noise that it rests on."""
    design = jacobian.reshape(len(jacobian), -1).T
    # a run that was left out of the fit says nothing of the noise
    told = [(rows, size) for rows, size in zip(*_sequences_of(batch), strict=True) if len(rows)]
    sequences, sizes = zip(*told, strict=True)
    covariance, _, noise = least_squares_covariance(
        design, residual.ravel(), sequences, sizes=sizes
    )
    return covariance, noise


def _sequences_of(batch: Batch) -> tuple[list[np.ndarray], list[float]]:
    """Return the rows of each run in a flattened residual, and the size of noise alike in all.

    Every run has a weight of one in all, however many samples share it; so where records are
    equally noisy, residuals of a long run are the smaller ones.
    """
    seen = np.asarray(batch.weight) > 0
    rows = np.arange(seen.size).reshape(seen.shape)
    sequences = [row[kept] for row, kept in zip(rows, seen, strict=True)]
    return sequences, [1.0 / np.sqrt(max(len(own), 1)) for own in sequences]
