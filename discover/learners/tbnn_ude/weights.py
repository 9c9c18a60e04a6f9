"""The numbers of a law that a round of training moves, as one well-scaled vector."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, ArrayLike, Bool, Float, Int

from discover.laws.tensor_basis_network import N_COEFFICIENTS, TensorBasisNetwork
from discover.programs import compiled, on_device


def split_law(law: TensorBasisNetwork) -> tuple[TensorBasisNetwork, TensorBasisNetwork]:
    """Return the trainable part of a law (network and constants) and the rest."""
    spec = jax.tree.map(lambda _: False, law)
    spec = eqx.tree_at(
        lambda tree: (tree.network, tree.constants),
        spec,
        (jax.tree.map(eqx.is_inexact_array, law.network), True),
        is_leaf=lambda leaf: leaf is None,  # a law of constants has no network
    )
    return eqx.partition(law, spec)


def weights_of(law: TensorBasisNetwork) -> Float[Array, " p"]:
    """Return all trainable numbers of a law: those of the network, then the eight constants."""
    return ravel_pytree(split_law(law)[0])[0]


def _count_of(law: TensorBasisNetwork) -> int:
    return sum(leaf.size for leaf in jax.tree.leaves(split_law(law)[0]))


def places_of(law: TensorBasisNetwork) -> TensorBasisNetwork:
    """Return the law with every trainable number replaced by its place in `weights_of`."""
    leaves, structure = jax.tree.flatten(split_law(law)[0])
    ends = np.cumsum([leaf.size for leaf in leaves])
    # on the host, so that it is known while a program is traced
    return structure.unflatten(
        np.arange(end - leaf.size, end).reshape(leaf.shape)
        for end, leaf in zip(ends, leaves, strict=True)
    )


class Rebuild(eqx.Module):
    """Makes a law from a vector that holds some of its numbers.

    The variational equation carries a column for every entry of the vector, so numbers that never
    move in a round are left out of it; those that merely happen not to are held by a mask, which
    needs no other program.
    """

    template: TensorBasisNetwork  # a law; what is not in the vector comes from it
    positions: Int[Array, " q"]  # place of each entry among all trainable numbers, shape (q,)
    moves: Bool[Array, " q"]  # false where an entry keeps the template's value, shape (q,)
    scale: Float[Array, " q"]  # size of each entry's unit, shape (q,)

    @classmethod
    def everything(cls, law: TensorBasisNetwork) -> "Rebuild":
        """Return the vector of all trainable numbers."""
        n = _count_of(law)
        return cls(law, jnp.arange(n), jnp.ones(n, bool), jnp.ones(n))

    @classmethod
    def of_constants(
        cls, law: TensorBasisNetwork, moving: Bool[ArrayLike, "8"], scale: Float[ArrayLike, "8"]
    ) -> "Rebuild":
        """Return the vector of the eight constants.

        `law`: the template. `moving`: which of them move. `scale`: unit of each: a constant is as
        large as the stress that it contributes.
        """
        n = _count_of(law)
        positions = on_device(np.arange(n - N_COEFFICIENTS, n))
        return cls(law, positions, on_device(np.asarray(moving)), on_device(np.asarray(scale)))

    @classmethod
    def with_network(
        cls, law: TensorBasisNetwork, moving: Bool[ArrayLike, "8"], scale: Float[ArrayLike, "8"]
    ) -> "Rebuild":
        """Return the vector of the network's weights, then the eight constants.

        Output weights of tensors that do not move act on nothing and are left out, so the length
        depends on how many move, not on which.

        Parameters as in `of_constants`; `moving` must be known when a program is compiled.
        """
        moving = np.asarray(moving)
        network: Any = places_of(law).network
        last = network.layers[-1]  # its bias is there: it was made with one
        idle = np.append(last.weight[~moving], last.bias[~moving])
        positions = np.setdiff1d(np.arange(_count_of(law)), idle)
        of_network = np.ones(positions.size - N_COEFFICIENTS)
        return cls(
            law,
            jnp.asarray(positions),
            jnp.concatenate([jnp.asarray(of_network, bool), jnp.asarray(moving)]),
            jnp.concatenate([jnp.asarray(of_network), jnp.asarray(scale)]),
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


@compiled
def _start(rebuild):
    return weights_of(rebuild.template)[rebuild.positions] / rebuild.scale


@compiled
def rebuilt(rebuild: Rebuild, weights: Float[Array, " q"]) -> TensorBasisNetwork:
    """Return the law with these numbers, by one compiled program."""
    return rebuild(weights)
