"""A preference for few and constant coefficients, which shear stress alone cannot supply.

Different coefficient functions give the same σ12 in every shear flow but different normal
stresses. What a network says of N2 is therefore decided by the prior and not by the data; this one
prefers the law in which few tensors act and their coefficients do not vary. It reads

    κ Σ_n w_n ⟨(g_n |T_n|)²⟩ + κ Σ_n v_n ⟨((g_n − ⟨g_n⟩) |T_n|)²⟩,

averaged over states along the trajectories, with w_n and v_n the reciprocals of the root mean
squares found in the previous round. At convergence it is κ times the sum of these root mean
squares: a group penalty that removes whole tensors   [Yuan & Lin 2006; reweighting: Candès et al.
2008].
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from discover.laws.tensor_basis_network import N_COEFFICIENTS, TensorBasisNetwork
from discover.learners.tbnn_ude.problem import TrainingProblem
from discover.learners.tbnn_ude.variational import Along, trajectories
from discover.programs import compiled
from tensor_library.algebra import inner
from tensor_library.integrity_basis import integrity_basis
from tensor_library.kinematics import rate_of_deformation

STATES_PER_RUN = 8
"""Enough to see where a coefficient varies; every state is 16 rows of each least-squares step."""

_FLOOR = 1e-4
"""Weights stop growing where a term is below 1e-4 of the stress: it is gone by then."""


class Cloud(eqx.Module):
    """States along the trajectories of a law, at which a network is looked at.

    `weight`: what a state counts for, shape (m,): one where there is one mode. Of several modes
        each counts by its modulus over the stress of the run: a slow one's dimensionless stress may
        be a million, and its modulus too small for the record to show it.
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
    """Return the weights of a plain quadratic penalty on variation, the same for every tensor.

    `strength`: κ. Amounts are penalised 1e-5 times as much: only where the data say nothing of
    them.
    """
    every = strength * jnp.ones(N_COEFFICIENTS)
    return PriorWeights(1e-5 * every, every)
