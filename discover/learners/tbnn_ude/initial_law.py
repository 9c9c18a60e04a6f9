"""Laws before they are trained, and with fewer tensors."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.tensor_basis_network import N_COEFFICIENTS, TensorBasisNetwork
from discover.learners.tbnn_ude.prior import Cloud, parts
from discover.programs import compiled, on_device
from tensor_library.invariants import scalar_invariants


@eqx.filter_jit
def initial_law(
    key: PRNGKeyArray,
    width: int,
    linear_relaxation: bool,
    invariant_scale: Float[Array, "8"],
    base_law: AbstractConstitutiveLaw | None = None,
) -> TensorBasisNetwork:
    """Return a law with h = 0: the last layer starts at zero, the hidden ones at random."""
    law = TensorBasisNetwork.initialise(key, width, 2, linear_relaxation)
    law = eqx.tree_at(lambda tree: tree.base, law, base_law, is_leaf=lambda leaf: leaf is None)
    last = law.network.layers[-1]
    law = eqx.tree_at(
        lambda tree: (tree.network.layers[-1].weight, tree.network.layers[-1].bias),
        law,
        (jnp.zeros_like(last.weight), jnp.zeros_like(last.bias)),
    )
    return eqx.tree_at(
        lambda tree: tree.invariant_scale, law, invariant_scale, is_leaf=lambda leaf: leaf is None
    )


def without_network(
    linear_relaxation: bool, base_law: AbstractConstitutiveLaw | None = None
) -> TensorBasisNetwork:
    """Return a law with h = 0 whose coefficients are constants."""
    zero = on_device(np.zeros(N_COEFFICIENTS))
    return TensorBasisNetwork(
        network=None,
        constants=zero,
        network_mask=zero,
        linear_relaxation=linear_relaxation,
        base=base_law,
    )


@compiled
def invariant_sizes(cloud: Cloud) -> Float[Array, "8"]:
    """Return the root mean square of every invariant, or one where it vanishes."""
    invariants = jax.vmap(scalar_invariants)(cloud.stress, cloud.rate)
    shares = (cloud.weight**2 / jnp.mean(cloud.weight**2))[:, None]
    size = jnp.sqrt(jnp.mean(shares * invariants**2, axis=0))
    return jnp.where(size > 1e-12, size, 1.0)


@compiled
def constant_scale(cloud: Cloud) -> Float[Array, "8"]:
    """Return the unit of each constant: one over the root mean square of its tensor."""
    size = jnp.sqrt(jnp.mean(cloud.size**2, axis=0))
    return 1.0 / jnp.maximum(size, 1e-6)


def with_tensors(law: TensorBasisNetwork, tensors: np.ndarray) -> TensorBasisNetwork:
    """Return the law in which the coefficients of these tensors may vary."""
    mask = jnp.asarray(tensors, dtype=law.network_mask.dtype)
    return eqx.tree_at(lambda tree: tree.network_mask, law, mask)


def without_empty_terms(
    law: TensorBasisNetwork, cloud: Cloud, removed_below: float
) -> TensorBasisNetwork:
    """Return the law without the terms, and the variations, that the prior has emptied."""
    amount, variation = (
        np.sqrt(np.mean(np.asarray(rows) ** 2, axis=0)) for rows in parts(law, cloud)
    )
    limit = removed_below * max(float(np.max(amount)), 1e-12)
    present = amount > limit
    varying = present & (variation > limit) & (np.asarray(law.network_mask) > 0)
    # A coefficient that stops varying keeps its mean
    mean = np.mean(np.asarray(cloud.coefficients(law)), axis=0)
    constants = np.where(varying, np.asarray(law.constants), np.where(present, mean, 0.0))
    return eqx.tree_at(
        lambda tree: (tree.constants, tree.network_mask),
        law,
        (jnp.asarray(constants), jnp.asarray(varying, dtype=law.network_mask.dtype)),
    )
