"""Changes of records and fits with errors of moduli and solvent, as a linear sweep leaves them."""

import numpy as np
from jaxtyping import Float

from discover.forward.augmented_model import AugmentedModel
from discover.forward.batches import Batch
from discover.statistics import root_of

_SHIFT = 0.1
"""Standard deviations by which moduli are moved; what a rate controls is linear in them."""


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


def response(
    jacobian: Float[np.ndarray, "free runs n"], shifts: Float[np.ndarray, "k runs n"]
) -> Float[np.ndarray, "free k"]:
    """Return by how much fitted parameters come out wrong with each error of the moduli."""
    design = jacobian.reshape(len(jacobian), -1).T
    scale = np.linalg.norm(design, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    target = shifts.reshape(len(shifts), -1).T
    return np.linalg.lstsq(design / scale, target, rcond=None)[0] / scale[:, None]
