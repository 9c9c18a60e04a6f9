"""Intervals of fitted parameters from the Fisher information of the trajectories."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.stats import t as student

from discover.learners.tensor_sindy.problem import TrajectoryProblem
from discover.learners.tensor_sindy.refit import Fit
from discover.learners.tensor_sindy.sensitivities import linearise


def standard_errors(
    problem: TrajectoryProblem, fit: Fit
) -> tuple[Float[np.ndarray, " q"], Float[np.ndarray, " m"], float]:
    """Return standard errors of coefficients and inner parameters, and Student's 95 % factor.

    The noise is taken as white with the variance of the residual; inner parameters of closed
    forms that the fit does not use have no error (nan).

    Parameters
    ----------
    problem
        The data.
    fit
        A fit on all rows.
    """
    n = len(problem.library)
    residual, columns = linearise(problem, jnp.asarray(fit.dense(n)), jnp.asarray(fit.inner))
    residual, columns = np.asarray(residual), np.asarray(columns)
    used = {problem.library.terms[i].closed_form for i in fit.support}
    inner = [n + i for i, form in enumerate(problem.library.forms) if form.name in used]
    chosen = columns[:, [*fit.support, *inner]]
    free = max(problem.n_observations - chosen.shape[1], 1)
    variance = float(residual @ residual) / free
    norms = np.linalg.norm(chosen, axis=0)
    norms = np.where(norms > 0, norms, 1.0)
    information = (chosen / norms).T @ (chosen / norms)
    errors = np.sqrt(np.diag(np.linalg.pinv(information, rcond=1e-14)) * variance) / norms
    inner_errors = np.full(len(problem.library.forms), np.nan)
    for position, column in enumerate(inner):
        inner_errors[column - n] = errors[len(fit.support) + position]
    return errors[: len(fit.support)], inner_errors, float(student.ppf(0.975, free))
