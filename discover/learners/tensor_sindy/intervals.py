"""Intervals of fitted parameters, from the sensitivities of the integrated trajectories."""

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.stats import t as student

from discover.learners.tensor_sindy.refit import Fit
from discover.learners.trajectories.modulus_errors import ModulusErrors, modulus_columns
from discover.learners.trajectories.problem import TrajectoryProblem
from discover.learners.trajectories.sensitivities import linearise
from discover.statistics import HALF_BAND, NoiseModel, least_squares_covariance


@dataclass(frozen=True)
class ParameterUncertainty:
    """How well a fit determines its parameters.

    Attributes
    ----------
    covariance
        Of the coefficients of the support, then of the inner parameters used, shape (p, p), by
        noise and by errors of the moduli.
    inverse
        (SᵀS)⁻¹ of the fit, in the same order.
    inner_positions
        Which inner parameters of the library those are.
    numerical
        What an integration error of the size of the misfit floor can do to each, shape (p,).
    factor
        Student's 95 % factor at the effective number of samples.
    noise
        The noise the residual shows.
    floor
        Relative misfit below which the integration itself is in doubt.
    modulus_errors
        What the moduli may be off by, which the covariance allows for; None where they are exact.
    """

    covariance: Float[np.ndarray, "p p"]
    inverse: Float[np.ndarray, "p p"]
    inner_positions: tuple[int, ...]
    numerical: Float[np.ndarray, " p"]
    factor: float
    noise: NoiseModel
    floor: float = 0.0
    modulus_errors: ModulusErrors | None = None

    @property
    def total_covariance(self) -> Float[np.ndarray, "p p"]:
        """Covariance of noise and of what integration cannot promise, as one more error.

        The second has the shape of the fit: constants that exchange each other do so in it too.
        """
        return self.covariance + self.inverse * (self.floor / HALF_BAND) ** 2

    @property
    def half_widths(self) -> Float[np.ndarray, " p"]:
        """Half the width of each 95 % interval: noise, plus what integration cannot promise."""
        return self.factor * np.sqrt(np.diag(self.covariance)) + self.numerical

    def given(
        self, values: Float[np.ndarray, " p"], position: int, value: float
    ) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, " p"]]:
        """Return what the fit and half its intervals become if one parameter is known.

        Least squares under the constraint, to first order in the change: with H = (SᵀS)⁻¹ and
        h its column of the known parameter, all parameters move by −h (θ − value)/h_known.

        Parameters
        ----------
        values
            The fitted parameters, in the order of `covariance`.
        position
            Of the known one.
        value
            What it is known to be.
        """
        share = self.inverse[:, position] / self.inverse[position, position]
        project = np.eye(len(values))
        project[:, position] -= share
        covariance = project @ self.covariance @ project.T
        left = np.diag(project @ self.inverse)
        numerical = self.numerical * np.sqrt(np.clip(left / np.diag(self.inverse), 0.0, 1.0))
        half = self.factor * np.sqrt(np.clip(np.diag(covariance), 0.0, None)) + numerical
        return values - share * (values[position] - value), half


def parameter_uncertainty(
    problem: TrajectoryProblem, fit: Fit, misfit_floor: float, slots: int = 1
) -> ParameterUncertainty:
    """Return the uncertainty of a fit's coefficients and inner parameters.

    Parameters
    ----------
    fit
        A fit on all rows, with at least one term.
    misfit_floor
        Relative misfit below which the integration itself is in doubt.
    slots
        Largest size of a support; sets the shape of a compiled program.
    """
    slots = max(slots, len(fit.support))
    residual, chosen, inner = sensitivities_at(problem, fit)
    shared = None
    if np.any(np.asarray(problem.modulus_error)):
        shared = modulus_columns(problem, fit.support, slots, fit.coefficients, fit.inner)
    covariance, inverse, noise = least_squares_covariance(
        chosen, residual, problem.records.sequences(), shared
    )
    free = max(noise.effective_samples - chosen.shape[1], 1.0)
    return ParameterUncertainty(
        covariance=covariance,
        inverse=inverse,
        inner_positions=inner,
        # an error vector of norm f moves a least-squares solution by at most f √diag (SᵀS)⁻¹
        numerical=misfit_floor * np.sqrt(np.diag(inverse)),
        factor=float(student.ppf(0.975, free)),
        noise=noise,
        floor=misfit_floor,
        modulus_errors=None
        if shared is None
        else ModulusErrors(np.asarray(problem.modulus_error), inverse @ (chosen.T @ shared)),
    )


def sensitivities_at(
    problem: TrajectoryProblem, fit: Fit
) -> tuple[Float[np.ndarray, " rows"], Float[np.ndarray, "rows p"], tuple[int, ...]]:
    """Return residual, sensitivities to a fit's parameters, and which inner ones those are."""
    n = len(problem.library)
    residual, columns = linearise(problem, jnp.asarray(fit.dense(n)), jnp.asarray(fit.inner))
    used = {problem.library.terms[i].closed_form for i in fit.support}
    inner = tuple(i for i, form in enumerate(problem.library.forms) if form.name in used)
    chosen = np.asarray(columns)[:, [*fit.support, *(n + i for i in inner)]]
    return np.asarray(residual), chosen, inner
