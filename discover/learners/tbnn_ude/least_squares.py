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
from discover.learners.tbnn_ude.problem import TrainingProblem, trajectories
from discover.learners.tbnn_ude.variational import residual_of_weights
from discover.learners.tbnn_ude.weights import Rebuild

# Normal equations halve the digits, which is harmless here: the damping keeps them well
# conditioned, and they cost a sixth of an orthogonal factorisation.
_SOLVER = optimistix.LevenbergMarquardt(
    rtol=1e-9, atol=1e-11, linear_solver=lineax.Normal(lineax.Cholesky())
)
# The solver's first damping is one. Residuals of relative size, by parameters in their own units,
# have a curvature far below that: unscaled, every descent would begin as a slow gradient descent.
_AMPLIFICATION = 30.0
_PATIENCE = 4
_LEAST_PROGRESS = 1e-3
_MOST_REJECTED = 8

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
    """Return data and prior as one amplified vector of residuals, and the data's part by run."""
    data = residual_of_weights(weights, rebuild=objective.rebuild, problem=objective.problem)
    data = data * data_scale(objective.problem)
    prior = prior_residual(objective.rebuild(weights), objective.cloud, objective.prior)
    return _AMPLIFICATION * jnp.concatenate([data.ravel(), prior]), data


class Stopping:
    """Decides when a descent has ended: at its target, or when steps no longer pay.

    A rejected step is no sign of an end: it teaches the damping. Only steps taken count, unless
    one rejection follows another.

    Parameters
    ----------
    target
        Misfit that is good enough.
    """

    def __init__(self, target: float):
        self.target = target
        self.taken: list[float] = []
        self.rejected = 0

    def done(self, misfit: float) -> bool:
        """Return whether to stop, given the misfit after another step."""
        if np.isfinite(misfit):
            if self.taken and misfit == self.taken[-1]:
                self.rejected += 1
            else:
                self.taken.append(misfit)
                self.rejected = 0
        if misfit < self.target or self.rejected >= _MOST_REJECTED:
            return True
        recent = self.taken[-_PATIENCE - 1 :]
        return len(recent) > _PATIENCE and recent[0] - recent[-1] < _LEAST_PROGRESS * recent[0]


@eqx.filter_jit
def first_state(weights: Float[Array, " p"], objective: Objective):
    """Return the solver's state before the first step."""
    rows, by_run = eqx.filter_eval_shape(residual_rows, weights, objective)
    return _SOLVER.init(residual_rows, weights, objective, {}, rows, by_run, frozenset())


@eqx.filter_jit
def next_state(weights: Float[Array, " p"], objective: Objective, state):
    """Return weights, the solver's state and the residuals after one more step."""
    weights, state, aux = _SOLVER.step(residual_rows, weights, objective, {}, state, frozenset())
    return weights, state, aux


def law_misfit(law: TensorBasisNetwork, problem: TrainingProblem) -> Float[Array, "runs n"]:
    """Return the data's residuals under a law; their norm is the relative misfit."""
    return _misses(trajectories(law, problem), problem)


@eqx.filter_jit
def _misses(states, problem):
    predicted = jnp.tensordot(states[..., 3], problem.modulus, axes=1)
    misses = jnp.where(problem.grids.sample_mask, predicted - problem.target, 0.0)
    return misses * data_scale(problem)


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
    state = first_state(weights, objective)
    best, stopping = weights, Stopping(target)
    for _ in range(steps):
        weights, state, _ = next_state(weights, objective, state)
        misfit = norm_of_cost(float(state.f_info.as_min()))
        if np.isfinite(misfit):
            best = weights
        if callback is not None:
            callback(misfit)
        if stopping.done(misfit):
            break
    return best


def norm_of_cost(cost: float) -> float:
    """Return the norm of residuals from half the sum of squares of the amplified ones."""
    return float(np.sqrt(max(2.0 * cost, 0.0))) / _AMPLIFICATION
