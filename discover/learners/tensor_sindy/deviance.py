"""How far laws are from a fit, measured by the data: the likelihood of draws of its parameters."""

import numpy as np
from jaxtyping import Float

from discover.learners.tensor_sindy.intervals import ParameterUncertainty, sensitivities_at
from discover.learners.tensor_sindy.refit import Fit
from discover.learners.tensor_sindy.weighed_draws import (
    Deviance,
    WeighedDraws,
    exchangeable,
    weighed_draws,
)
from discover.learners.trajectories.problem import TrajectoryProblem
from discover.learners.trajectories.sensitivities import predict_many
from discover.programs import on_device
from discover.statistics import HALF_BAND


def draws_of_fit(
    problem: TrajectoryProblem,
    fit: Fit,
    uncertainty: ParameterUncertainty,
    slots: int,
    seed: int = 0,
) -> WeighedDraws:
    """Return what the data leave of a fit's parameters, by the predictions of every draw.

    Parameters
    ----------
    fit
        A fit on all rows, with at least one term.
    uncertainty
        Of the fit, linearised.
    slots
        Largest size of a support; sets the shape of the compiled program.
    """
    residual, columns, inner = sensitivities_at(problem, fit)
    centre = np.append(fit.coefficients, fit.inner[list(inner)])
    if exchangeable(uncertainty.inverse, columns):
        size = centre.size
        return weighed_draws(
            centre, np.full((size, size), np.inf), lambda laws: np.zeros(len(laws))
        )
    deviance = _deviance(problem, fit, uncertainty, residual, columns, inner, slots)
    return weighed_draws(centre, uncertainty.total_covariance, deviance, seed)


def _deviance(problem, fit, uncertainty, residual, columns, inner, slots) -> Deviance:
    """Return the deviance D of laws from the fit.

    With d a law's prediction minus the fit's, u = (SᵀS)⁻¹Sᵀd its best imitation by the
    linearisation and r the residual of the fit, D = uᵀC⁻¹u + (|d − Su|² + 2 r·(d − Su)) / s²: the
    first part alone, with C the covariance of correlated noise, is all where the law is linear.
    """
    n = len(fit.support)
    slots = max(slots, n)
    active = np.zeros(slots, dtype=int)
    active[:n] = fit.support
    scale = np.sqrt(np.diag(uncertainty.total_covariance))
    scaled = uncertainty.total_covariance / np.outer(scale, scale)
    precision = np.linalg.pinv(scaled, hermitian=True, rcond=1e-13) / np.outer(scale, scale)
    imitate = np.linalg.pinv(columns * scale, rcond=1e-13).T * scale
    values = problem.records.n_observations
    free = max(values - columns.shape[1], 1)
    remembered = values / max(uncertainty.noise.effective_samples, 1.0)
    size = np.sum(residual**2) / free * max(remembered, 1.0) + (uncertainty.floor / HALF_BAND) ** 2
    forms = problem.library.inner_bounds
    bounds = np.array([forms[i] for i in inner], dtype=float).reshape(-1, 2)

    def deviance(laws: Float[np.ndarray, "laws p"]) -> Float[np.ndarray, " laws"]:
        coefficients = np.zeros((len(laws), slots))
        coefficients[:, :n] = laws[:, :n]
        inners = np.array(np.tile(fit.inner, (len(laws), 1)))
        inners[:, list(inner)] = laws[:, n:]
        inside = np.all((laws[:, n:] >= bounds[:, 0]) & (laws[:, n:] <= bounds[:, 1]), axis=1)
        predicted = predict_many(
            problem, on_device(active), on_device(coefficients), on_device(inners)
        )
        apart = np.asarray(predicted) - fit.predicted
        sane = inside & np.all(np.isfinite(apart), axis=1)
        with np.errstate(invalid="ignore", over="ignore"):
            imitated = np.nan_to_num(apart) @ imitate
            beyond = apart - imitated @ columns.T
            parts = np.einsum("ni,ij,nj->n", imitated, precision, imitated)
            curved = np.sum(beyond**2, axis=1) + 2.0 * beyond @ residual
            found = parts + curved / size
        return np.where(sane & np.isfinite(found), found, np.inf)

    return deviance
