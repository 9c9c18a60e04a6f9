"""The numbers of a law that a round of training moves, as one well-scaled vector."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, ArrayLike, Bool, Float, Int

from discover.laws.tensor_basis_network import N_COEFFICIENTS, TensorBasisNetwork


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
    """Return all trainable numbers of a law: those of the network, then the eight constants."""
    return ravel_pytree(split_law(law)[0])[0]


class Rebuild(eqx.Module):
    """Makes a law from a vector that holds some of its numbers.

    The variational equation carries a column for every entry of the vector, so numbers that never
    move in a round are left out of it; those that merely happen not to are held by a mask, which
    needs no other program.

    Attributes
    ----------
    template
        A law; what is not in the vector comes from it.
    positions
        Place of each entry among all trainable numbers, shape (q,).
    moves
        False where an entry keeps the template's value, shape (q,).
    scale
        Size of each entry's unit, shape (q,).
    """

    template: TensorBasisNetwork
    positions: Int[Array, " q"]
    moves: Bool[Array, " q"]
    scale: Float[Array, " q"]

    @classmethod
    def everything(cls, law: TensorBasisNetwork) -> "Rebuild":
        """Return the vector of all trainable numbers."""
        n = weights_of(law).shape[0]
        return cls(law, jnp.arange(n), jnp.ones(n, bool), jnp.ones(n))

    @classmethod
    def of_constants(
        cls,
        law: TensorBasisNetwork,
        moving: Bool[ArrayLike, "8"],
        scale: Float[ArrayLike, "8"],
    ) -> "Rebuild":
        """Return the vector of the eight constants.

        Parameters
        ----------
        law
            The template.
        moving
            Which of them move.
        scale
            Unit of each: a constant is as large as the stress that it contributes.
        """
        n = weights_of(law).shape[0]
        positions = jnp.arange(n - N_COEFFICIENTS, n)
        return cls(law, positions, jnp.asarray(moving), jnp.asarray(scale))

    @classmethod
    def with_network(
        cls,
        law: TensorBasisNetwork,
        moving: Bool[ArrayLike, "8"],
        scale: Float[ArrayLike, "8"],
    ) -> "Rebuild":
        """Return the vector of all weights of the network, then the eight constants.

        Parameters as in `of_constants`.
        """
        network = np.ones(weights_of(law).shape[0] - N_COEFFICIENTS)
        return cls(
            law,
            jnp.arange(network.size + N_COEFFICIENTS),
            jnp.concatenate([jnp.asarray(network, bool), jnp.asarray(moving)]),
            jnp.concatenate([jnp.asarray(network), jnp.asarray(scale)]),
        )

    @property
    def start(self) -> Float[Array, " q"]:
        """The vector that makes the template."""
        return _start(self)

    def __call__(self, weights: Float[Array, " q"]) -> TensorBasisNetwork:
        """Return the law with these numbers."""
        dynamic, static = split_law(self.template)
        held, unravel = ravel_pytree(dynamic)
        moved = jnp.where(self.moves, self.scale * weights, held[self.positions])
        return eqx.combine(unravel(held.at[self.positions].set(moved)), static)


@eqx.filter_jit
def _start(rebuild):
    return weights_of(rebuild.template)[rebuild.positions] / rebuild.scale


@eqx.filter_jit
def rebuilt(rebuild: Rebuild, weights: Float[Array, " q"]) -> TensorBasisNetwork:
    """Return the law with these numbers, by one compiled program."""
    return rebuild(weights)
