"""All trainable numbers of a law in one vector, some of them held."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, ArrayLike, Bool, Float

from discover.laws.tensor_basis_network import TensorBasisNetwork


def split_law(law: TensorBasisNetwork) -> tuple[TensorBasisNetwork, TensorBasisNetwork]:
    """Return the trainable part of a law (network and constants) and the rest."""
    spec = jax.tree.map(lambda _: False, law)
    spec = eqx.tree_at(
        lambda tree: (tree.network, tree.constants),
        spec,
        (jax.tree.map(eqx.is_inexact_array, law.network), True),
    )
    return eqx.partition(law, spec)


def weights_of(law: TensorBasisNetwork) -> Float[Array, " p"]:
    """Return the trainable numbers of a law: those of the network, then the eight constants."""
    return ravel_pytree(split_law(law)[0])[0]


class Rebuild(eqx.Module):
    """Makes a law from a weight vector, in which some entries are held.

    Attributes
    ----------
    template
        A law of the right shape; what is not trainable comes from it.
    trainable
        False where a weight keeps the template's value, shape (p,).
    """

    template: TensorBasisNetwork
    trainable: Bool[Array, " p"]

    def __call__(self, weights: Float[Array, " p"]) -> TensorBasisNetwork:
        """Return the law with these weights."""
        dynamic, static = split_law(self.template)
        held, unravel = ravel_pytree(dynamic)
        return eqx.combine(unravel(jnp.where(self.trainable, weights, held)), static)


def trainable_mask(
    law: TensorBasisNetwork, constants: Bool[ArrayLike, "8"], network: bool
) -> Bool[Array, " p"]:
    """Return which weights may move: some constants, and all or none of the network."""
    dynamic, _ = split_law(law)
    flags = eqx.tree_at(
        lambda tree: tree.constants,
        jax.tree.map(lambda leaf: jnp.full(leaf.shape, network), dynamic),
        jnp.asarray(constants),
    )
    return ravel_pytree(flags)[0].astype(bool)
