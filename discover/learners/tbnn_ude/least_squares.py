"""Levenberg–Marquardt on trajectories and prior together, one step at a time."""

from collections.abc import Callable, Sequence
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from discover.inference.least_squares.tangents import Linearised, Steps
from discover.laws.tensor_basis_network import TensorBasisNetwork
from discover.learners.tbnn_ude.prior import Cloud, PriorWeights, prior_residual
from discover.learners.tbnn_ude.problem import TrainingProblem
from discover.learners.tbnn_ude.variational import (
    Along,
    side_by_side,
    states_and_jacobian,
    trajectories,
)
from discover.learners.tbnn_ude.weights import Rebuild
from discover.programs import compiled, on_device

_PATIENCE = 4
_LEAST_PROGRESS = 1e-3
_MOST_REJECTED = 8
_FAIR_STEPS = 4
_FAR_BEHIND = 5.0

Callback = Callable[[float], None]
Integrate = Callable[[Array, Rebuild, TrainingProblem], tuple[Along, Float[Array, "runs n p"]]]


class Objective(eqx.Module):
    """What a round of training minimises, apart from the weights.

    `cloud`, `prior`: where the prior looks, and how strong it is.
    """

    problem: TrainingProblem
    rebuild: Rebuild  # which weights move, and the law around them
    cloud: Cloud
    prior: PriorWeights


def linearise(
    weights: Float[Array, " p"], objective: Objective, integrate: Integrate = states_and_jacobian
) -> Linearised:
    """Return the objective around some weights.

    The integration is a program of its own, apart from the solver's step: compiled inside it, it
    took as long again. Outside of a transformation it may be done by `side_by_side`.
    """
    along, jacobian = integrate(weights, objective.rebuild, objective.problem)
    return _with_prior(weights, objective, along, jacobian)


@partial(compiled, runs_long=True)
def _with_prior(weights, objective, along, jacobian):
    misses, data = objective.problem.records.linearised(along.recorded, jacobian)

    def prior(weights):
        return prior_residual(objective.rebuild(weights), objective.cloud, objective.prior)

    rows = jnp.concatenate([misses.ravel(), prior(weights)])
    matrix = jnp.concatenate([data.reshape(misses.size, -1), jax.jacfwd(prior)(weights)])
    return Linearised(rows, matrix)


class Stopping:
    """Decides when a descent has ended: at its target, or when steps no longer pay.

    A rejected step is no sign of an end: it teaches the damping. Only steps taken count, unless
    one rejection follows another. Of two descents that compete, the one far behind is given up.

    `target`: misfit that is good enough. `pace`: misfits of a rival after each of its steps, or
    None.
    """

    def __init__(self, target: float, pace: Sequence[float] | None = None):
        self.target = target
        self.pace = pace
        self.steps = 0
        self.taken: list[float] = []
        self.rejected = 0

    def done(self, misfit: float) -> bool:
        """Return whether to stop, given the misfit after another step."""
        self.steps += 1
        if np.isfinite(misfit):
            if self.taken and misfit == self.taken[-1]:
                self.rejected += 1
            else:
                self.taken.append(misfit)
                self.rejected = 0
        if misfit < self.target or self.rejected >= _MOST_REJECTED or self._far_behind(misfit):
            return True
        recent = self.taken[-_PATIENCE - 1 :]
        return len(recent) > _PATIENCE and recent[0] - recent[-1] < _LEAST_PROGRESS * recent[0]

    def _far_behind(self, misfit: float) -> bool:
        if self.pace is None or self.steps < _FAIR_STEPS:
            return False
        return not misfit < _FAR_BEHIND * self.pace[min(self.steps, len(self.pace)) - 1]


def law_misfit(law: TensorBasisNetwork, problem: TrainingProblem) -> Float[Array, "runs n"]:
    """Return the data's residuals under a law; their norm is the relative misfit."""
    return relative_misses(trajectories(law, problem), problem)


@compiled
def relative_misses(along: Along, problem: TrainingProblem) -> Float[Array, "runs n"]:
    """Return the residuals of what is recorded, by one program."""
    return problem.records.residual(along.recorded)


def minimise(
    weights: Float[Array, " p"],
    objective: Objective,
    steps: int,
    callback: Callback | None = None,
    target: float = 0.0,
    pace: Sequence[float] | None = None,
) -> Float[Array, " p"]:
    """Return better weights after at most `steps` Levenberg–Marquardt steps.

    A step to weights whose trajectories run away has a misfit that is not finite; it is rejected
    and the damping grows.

    `weights`: where to start. `steps`: largest number of steps. `callback`: called after every step
    with the relative misfit of the best weights. `target`: stop when the norm of all residuals is
    below this. `pace`: misfits of a rival after each of its steps: stop when far behind it.
    """
    descent, stopping = Steps(weights), Stopping(target, pace)
    for _ in range(steps):
        descent.take(linearise(on_device(descent.trial), objective, side_by_side))
        if callback is not None:
            callback(descent.norm)
        if stopping.done(descent.norm) or not np.isfinite(descent.norm):
            break
    return on_device(descent.best)
