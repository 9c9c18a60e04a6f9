"""Levenberg–Marquardt on trajectories and prior together, one step at a time."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.linalg import cho_factor, cho_solve

from discover.laws.tensor_basis_network import N_COEFFICIENTS, TensorBasisNetwork
from discover.learners.tbnn_ude.problem import TrainingProblem
from discover.learners.tbnn_ude.variational import (
    Along,
    Rebuild,
    rebuilt,
    side_by_side,
    states_and_jacobian,
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
    every = strength * jnp.ones(N_COEFFICIENTS)
    return PriorWeights(1e-5 * every, every)


# The first damping is one, which is to be small beside the curvature: that of weights is far below
_OF_WEIGHTS = 30.0

# Of what a step promised, the shares from which on it is taken, and from which on the damping falls
_LEAST_KEPT, _MOST_KEPT = 0.01, 0.99
_MORE_DAMPING, _LESS_DAMPING = 4.0, 1.0 / 3.5


class Linearised(NamedTuple):
    """Objective around some parameters: residuals (rows,), and derivatives (rows, p)."""

    rows: Float[Array, " rows"]
    matrix: Float[Array, "rows p"]


class Steps:
    """Levenberg–Marquardt descent step by step, from linearisations computed elsewhere.

    Damping of a trust region [Moré 1978; constants: Gould et al. 2005, 4OR 3, 227, as optimistix],
    in NumPy: a program for each shape would take longer to compile than its steps take.

    Attributes
    ----------
    best, norm
        The best parameters so far, shape (p,), and the norm of the residuals there.
    trial
        The parameters where the objective is to be linearised next.
    """

    def __init__(self, start: Float[Array | np.ndarray, " p"]):
        self.best = self.trial = np.asarray(start)
        self.norm = np.nan
        self._damping = 1.0
        self._known: tuple[np.ndarray, ...] | None = None

    def goes_up(self, rows: Float[Array | np.ndarray, " rows"]) -> bool:
        """Return whether a trial with these residuals is rejected; the next one is then nearer."""
        with np.errstate(over="ignore", invalid="ignore"):  # of a trial that runs away
            found, promised = self._gains(_OF_WEIGHTS * np.asarray(rows))
        if self._known is None or found <= _LEAST_KEPT * promised:
            return False
        self._damping *= _MORE_DAMPING
        self._find_trial()
        return True

    def take(self, linearised: Linearised) -> None:
        """Take the step to the trial if it goes down, and find the next trial."""
        if self.goes_up(linearised.rows):
            return
        rows, matrix = (_OF_WEIGHTS * np.asarray(part) for part in linearised)
        found, promised = self._gains(rows)
        if found < _MOST_KEPT * promised:
            self._damping *= _LESS_DAMPING
        with np.errstate(over="ignore", invalid="ignore"):
            self.best, self.norm = self.trial, float(np.linalg.norm(rows)) / _OF_WEIGHTS
            self._known = rows, matrix, matrix.T @ matrix, matrix.T @ rows
        self._find_trial()

    def _gains(self, rows: np.ndarray) -> tuple[float, float]:
        """Return the change of the squares at the trial, and what the derivatives promised."""
        if self._known is None:
            return 0.0, 0.0
        before, matrix, *_ = self._known
        promised = np.sum((before + matrix @ (self.trial - self.best)) ** 2) - np.sum(before**2)
        found = float(np.sum(rows**2) - np.sum(before**2))
        return found if np.isfinite(found) else np.inf, float(promised)

    def _find_trial(self) -> None:
        assert self._known is not None
        _, _, curvature, slope = self._known
        damped = curvature + self._damping * np.eye(len(slope))
        self.trial = np.full_like(self.best, np.nan)
        if np.all(np.isfinite(damped)) and np.all(np.isfinite(slope)):
            with suppress(np.linalg.LinAlgError):  # more damping is asked for
                self.trial = self.best - cho_solve(cho_factor(damped), slope)


_PATIENCE = 4
_LEAST_PROGRESS = 1e-3
_MOST_REJECTED = 8
_FAIR_STEPS = 4
_FAR_BEHIND = 5.0

Callback = Callable[[float], None]
Integrate = Callable[[Array, Rebuild, TrainingProblem], tuple[Along, Float[Array, "runs n p"]]]


class Objective(eqx.Module):
    """Objective of a round of training: problem, law, and where and how strong the prior is."""

    problem: TrainingProblem
    rebuild: Rebuild  # which weights move, and the law around them
    cloud: Cloud
    prior: PriorWeights


def linearise(
    weights: Float[Array, " p"], objective: Objective, integrate: Integrate = states_and_jacobian
) -> Linearised:
    """Return the objective around some weights.

    The integration is a program apart from the solver's step: inside it, it compiles as long again.
    Outside of a transformation it may be done by `side_by_side`.
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


def residual(weights: Float[Array, " p"], objective: Objective) -> Float[np.ndarray, " rows"]:
    """Return the residuals of `linearise` alone, which cost a twelfth where a network varies."""
    law = rebuilt(objective.rebuild, weights)
    misses = np.asarray(law_misfit(law, objective.problem))
    prior = prior_residual(law, objective.cloud, objective.prior)
    return np.append(misses, np.asarray(prior))


class Stopping:
    """Stopping rule of a descent: at its target, or when steps no longer pay.

    Rejected steps teach the damping, so only steps taken count, unless many are rejected in a row.
    `target`: misfit that is accepted. `pace`: misfits of a rival after each of its steps; a descent
    far behind it is given up.
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
    weights: Float[Array, " p"], objective: Objective, steps: int, callback: Callback | None = None,
    target: float = 0.0, pace: Sequence[float] | None = None,
) -> Float[Array, " p"]:  # fmt: skip
    """Return better weights after at most `steps` Levenberg–Marquardt steps.

    `callback`: called after every step with the relative misfit of the best weights. `target`,
    `pace`: as of `Stopping`.
    """
    descent, stopping = Steps(weights), Stopping(target, pace)
    # of constants the derivatives cost nothing beside the states
    costly = objective.rebuild.template.network is not None
    for _ in range(steps):
        trial = on_device(descent.trial)
        if not (costly and descent.norm > 0.0 and descent.goes_up(residual(trial, objective))):
            descent.take(linearise(trial, objective, side_by_side))
        if callback is not None:
            callback(descent.norm)
        if stopping.done(descent.norm) or not np.isfinite(descent.norm):
            break
    return on_device(descent.best)
