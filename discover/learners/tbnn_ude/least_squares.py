"""Levenberg–Marquardt on trajectories and prior together, one step at a time."""

from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
import lineax
import numpy as np
import optimistix
from jaxtyping import Array, Float

from discover.laws.tensor_basis_network import TensorBasisNetwork
from discover.learners.tbnn_ude.prior import Cloud, PriorWeights, prior_residual
from discover.learners.tbnn_ude.problem import TrainingProblem
from discover.learners.tbnn_ude.variational import residual_of_weights
from discover.learners.tbnn_ude.weights import Rebuild

# Normal equations halve the digits, which is harmless here: the damping keeps them well
# conditioned, and they cost a sixth of an orthogonal factorisation.
_SOLVER = optimistix.LevenbergMarquardt(
    rtol=1e-9, atol=1e-11, linear_solver=lineax.Normal(lineax.Cholesky())
)
_PATIENCE = 4

Callback = Callable[[float], None]


class Objective(eqx.Module):
    """What a round of training minimises, apart from the weights.

    Attributes
    ----------
    problem
        The data.
    rebuild
        Which weights move, and the law around them.
    cloud, prior
        Where the prior looks, and how strong it is.
    """

    problem: TrainingProblem
    rebuild: Rebuild
    cloud: Cloud
    prior: PriorWeights


def data_scale(problem: TrainingProblem) -> Float[Array, "runs 1"]:
    """Return the factor that turns residuals into parts of the mean relative misfit."""
    mask = problem.grids.sample_mask
    count = jnp.sum(mask, axis=1)
    mean_square = jnp.sum(jnp.where(mask, problem.target, 0.0) ** 2, axis=1) / count
    # A run at rest has no scale of its own; unit modulus serves
    mean_square = jnp.where(mean_square > 0.0, mean_square, 1.0)
    return (1.0 / jnp.sqrt(mean_square * count * mask.shape[0]))[:, None]


def residual_rows(
    weights: Float[Array, " p"], objective: Objective
) -> tuple[Float[Array, " rows"], Float[Array, "runs n"]]:
    """Return data and prior as one vector of residuals, and the data's part by run."""
    data = residual_of_weights(weights, rebuild=objective.rebuild, problem=objective.problem)
    data = data * data_scale(objective.problem)
    prior = prior_residual(objective.rebuild(weights), objective.cloud, objective.prior)
    return jnp.concatenate([data.ravel(), prior]), data


@eqx.filter_jit
def _start(weights, objective):
    rows, by_run = eqx.filter_eval_shape(residual_rows, weights, objective)
    return _SOLVER.init(residual_rows, weights, objective, {}, rows, by_run, frozenset())


@eqx.filter_jit
def _step(weights, objective, state):
    weights, state, aux = _SOLVER.step(residual_rows, weights, objective, {}, state, frozenset())
    return weights, state, aux


@eqx.filter_jit
def law_misfit(law: TensorBasisNetwork, problem: TrainingProblem) -> Float[Array, "runs n"]:
    """Return the data's residuals under a law; their norm is the relative misfit."""
    return problem.residual(law) * data_scale(problem)


def minimise(
    weights: Float[Array, " p"],
    objective: Objective,
    steps: int,
    callback: Callback | None = None,
    target: float = 0.0,
) -> Float[Array, " p"]:
    """Return better weights after at most `steps` Levenberg–Marquardt steps.

    A step to weights whose trajectories run away has a misfit that is not finite; it is rejected
    and the damping grows.

    Parameters
    ----------
    weights
        Where to start.
    objective
        What to minimise.
    steps
        Largest number of steps.
    callback
        Called after every step with the relative misfit of the best weights.
    target
        Stop when the norm of all residuals is below this.
    """
    state = _start(weights, objective)
    best, history = weights, []
    for _ in range(steps):
        weights, state, _ = _step(weights, objective, state)
        cost = float(state.f_info.as_min())
        misfit = float(np.sqrt(max(2.0 * cost, 0.0)))
        if np.isfinite(misfit):
            best = weights
            history.append(misfit)
        if callback is not None:
            callback(misfit)
        if misfit < target:
            break
        recent = history[-_PATIENCE - 1 :]
        if len(recent) > _PATIENCE and recent[0] - recent[-1] < 1e-3 * recent[0]:
            break
    return best
