"""Least squares on trajectories and prior together."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy import optimize

from discover.laws.tensor_basis_network import N_COEFFICIENTS, TensorBasisNetwork
from discover.learners.tbnn_ude.problem import TrainingProblem
from discover.learners.tbnn_ude.variational import (
    Along,
    Rebuild,
    rebuilt,
    side_by_side,
    trajectories,
)
from discover.programs import compiled, on_device
from tensor_library import inner, integrity_basis, rate_of_deformation

STATES_PER_RUN = 8
"""Enough to see where a coefficient varies; every state is 16 rows of each least-squares step."""

_FLOOR = 1e-4
"""Weights stop growing where a term is below 1e-4 of the stress: it is gone by then."""


class Cloud(eqx.Module):
    """States along the trajectories of a law, at which a network is looked at.

    `weight`: one for a single mode; else modulus over stress of the run, as a slow mode's
    dimensionless stress may be huge and invisible. Shape (m,).
    """

    stress: Float[Array, "m 4"]  # dimensionless stress of a mode, shape (m, 4)
    rate: Float[Array, "m 4"]  # dimensionless rate of deformation, shape (m, 4)
    size: Float[Array, "m 8"]  # norm of each basis tensor, times the weight, shape (m, 8)
    weight: Float[Array, " m"]

    def coefficients(self, law: TensorBasisNetwork) -> Float[Array, "m 8"]:
        """Return the coefficients of a law at these states."""
        return _coefficients(law, self.stress, self.rate)


@compiled
def _coefficients(law, stress, rate):
    return jax.vmap(law.coefficients)(stress, rate)


def sample_states(law: TensorBasisNetwork, problem: TrainingProblem) -> Cloud:
    """Return states evenly spread over the samples of every run and mode."""
    return cloud_of(trajectories(law, problem), problem)


@compiled
def cloud_of(along: Along, problem: TrainingProblem) -> Cloud:
    """Return states evenly spread over the samples, of every mode there."""
    pick = jnp.linspace(1, along.rate.shape[1] - 1, STATES_PER_RUN).astype(int)
    stress = along.states[:, pick].reshape(-1, 4)
    shear_rate = (along.rate[:, pick, None] * problem.relaxation_time).reshape(-1)
    rate = jax.vmap(rate_of_deformation)(shear_rate)
    basis = jax.vmap(integrity_basis)(stress, rate)
    size = jnp.sqrt(jax.vmap(jax.vmap(inner))(basis, basis))
    weight = _weights(problem).ravel()
    return Cloud(stress, rate, weight[:, None] * size, weight)


def _weights(problem: TrainingProblem) -> Float[Array, "runs states k"]:
    shape = (len(problem.flows), STATES_PER_RUN, problem.modulus.size)
    if problem.modulus.size == 1:
        return jnp.ones(shape)
    # a run at rest, or not looked at, has no scale of its own
    scaled = (problem.stress > 0.0) & jnp.any(problem.records.weight > 0, axis=1)
    stress = jnp.where(scaled, problem.stress, jnp.sum(problem.modulus))
    return jnp.broadcast_to(problem.modulus / stress[:, None, None], shape)


class PriorWeights(eqx.Module):
    """Weights w_n and v_n of the prior, each of shape (8,), times κ."""

    amount: Float[Array, "8"]
    variation: Float[Array, "8"]


@compiled
def parts(law: TensorBasisNetwork, cloud: Cloud) -> tuple[Float[Array, "m 8"], Float[Array, "m 8"]]:
    """Return the size of every term, and of its departure from a constant coefficient."""
    coefficients = cloud.coefficients(law)
    mean = jnp.mean(coefficients, axis=0)
    return coefficients * cloud.size, (coefficients - mean) * cloud.size


@compiled
def prior_residual(
    law: TensorBasisNetwork, cloud: Cloud, weights: PriorWeights
) -> Float[Array, " r"]:
    """Return the prior as residuals whose squares sum to it."""
    amount, variation = parts(law, cloud)
    n = cloud.stress.shape[0]
    rows = [jnp.sqrt(weights.amount / n) * amount, jnp.sqrt(weights.variation / n) * variation]
    return jnp.concatenate([row.ravel() for row in rows])


@compiled
def reweighted(
    law: TensorBasisNetwork, cloud: Cloud, strength: float | Float[Array, ""]
) -> PriorWeights:
    """Return the weights of the next round, from the root mean squares of this one."""
    amount, variation = parts(law, cloud)

    def reciprocal(rows):
        return strength / (jnp.sqrt(jnp.mean(rows**2, axis=0)) + _FLOOR)

    return PriorWeights(reciprocal(amount), reciprocal(variation))


def least_variation(strength: float | Float[Array, ""]) -> PriorWeights:
    """Return the weights of a quadratic penalty κ on variation, the same for every tensor.

    Amounts are penalised 1e-5 times as much: only where the data say nothing of them.
    """
    every = np.full(N_COEFFICIENTS, strength)
    return PriorWeights(on_device(1e-5 * every), on_device(every))


_PATIENCE = 4
_LEAST_PROGRESS = 1e-3
_FAIR_STEPS = 4
_FAR_BEHIND = 5.0
_ROUNDING = 1e-12  # relative change of the weights that is none

Callback = Callable[[float], None]


class Objective(eqx.Module):
    """Objective of a round of training: problem, law, and where and how strong the prior is."""

    problem: TrainingProblem
    rebuild: Rebuild  # which weights move, and the law around them
    cloud: Cloud
    prior: PriorWeights


def residual(weights: Float[Array, " p"], objective: Objective) -> Float[np.ndarray, " rows"]:
    """Return the residuals of data and prior, a twelfth of the work of `derivatives`."""
    law = rebuilt(objective.rebuild, weights)
    misses = np.asarray(law_misfit(law, objective.problem))
    prior = prior_residual(law, objective.cloud, objective.prior)
    return np.append(misses, np.asarray(prior))


def derivatives(weights: Float[Array, " p"], objective: Objective) -> Float[Array, "rows p"]:
    """Return the derivatives of `residual` by the weights."""
    along, jacobian = side_by_side(weights, objective.rebuild, objective.problem)
    return _with_prior(weights, objective, along, jacobian)


@partial(compiled, runs_long=True)
def _with_prior(weights, objective, along, jacobian):
    misses, data = objective.problem.records.linearised(along.recorded, jacobian)

    def prior(weights):
        return prior_residual(objective.rebuild(weights), objective.cloud, objective.prior)

    return jnp.concatenate([data.reshape(misses.size, -1), jax.jacfwd(prior)(weights)])


class Stopping:
    """Stopping rule of a descent: at its target, or when steps no longer pay.

    `target`: misfit that is accepted. `pace`: misfits of a rival after each of its steps; a descent
    far behind it is given up.
    """

    def __init__(self, target: float, pace: Sequence[float] | None = None):
        self.target = target
        self.pace = pace
        self.misfits: list[float] = []

    def done(self, misfit: float) -> bool:
        """Return whether to stop, given the misfit after another step."""
        self.misfits.append(misfit)
        if misfit < self.target or self._far_behind(misfit):
            return True
        recent = self.misfits[-_PATIENCE - 1 :]
        return len(recent) > _PATIENCE and recent[0] - recent[-1] < _LEAST_PROGRESS * recent[0]

    def _far_behind(self, misfit: float) -> bool:
        if not self.pace or len(self.misfits) < _FAIR_STEPS:
            return False
        return not misfit < _FAR_BEHIND * self.pace[min(len(self.misfits), len(self.pace)) - 1]


def law_misfit(law: TensorBasisNetwork, problem: TrainingProblem) -> Float[Array, "runs n"]:
    """Return the data's residuals under a law; their norm is the relative misfit."""
    return relative_misses(trajectories(law, problem), problem)


@compiled
def relative_misses(along: Along, problem: TrainingProblem) -> Float[Array, "runs n"]:
    """Return the residuals of what is recorded, by one program."""
    return problem.records.residual(along.recorded)


def minimise(
    weights: Float[Array, " p"], objective: Objective, steps: int, callback: Callback | None = None,
    target: float = 0.0, pace: Sequence[float] | None = None,
) -> Float[Array, " p"]:  # fmt: skip
    """Return better weights after at most `steps` trials of a trust region.

    `callback`: called after every step that goes down with the relative misfit there. `target`,
    `pace`: as of `Stopping`. Weights whose law diverges are returned as they are.
    """
    stopping, start = Stopping(target, pace), np.asarray(weights)

    def rows(values: Float[np.ndarray, " p"]) -> Float[np.ndarray, " rows"]:
        return residual(on_device(values), objective)

    def matrix(values: Float[np.ndarray, " p"]) -> Float[np.ndarray, "rows p"]:
        found = np.asarray(derivatives(on_device(values), objective))
        return np.where(np.isfinite(found), found, 0.0)

    def after_step(intermediate_result: optimize.OptimizeResult) -> None:
        misfit = float(np.sqrt(2.0 * intermediate_result.cost))
        if callback is not None:
            callback(misfit)
        if stopping.done(misfit):
            raise StopIteration

    if not np.all(np.isfinite(rows(start))):
        return weights
    # when steps no longer pay is for `stopping` to say
    never = {"ftol": None, "gtol": None, "xtol": _ROUNDING}
    with np.errstate(over="ignore", invalid="ignore"):  # of a trial that runs away
        found = optimize.least_squares(
            rows, start, cast(Any, matrix), max_nfev=steps + 1, callback=after_step, **never
        )
    return on_device(found.x)
