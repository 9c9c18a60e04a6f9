"""Trees of arrays as one axis of numbers, as lanes take them."""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np


def as_array(values: Sequence[Any]) -> np.ndarray:
    """Return values as an array that holds them as they are."""
    found = np.empty(len(values), object)
    found[:] = values
    return found


class Layout:
    """Trees of arrays as one axis of numbers, and back.

    Parameters
    ----------
    tree
        One of them; what of it is no array is left out.
    axes
        How many leading axes each leaf has that stay apart.

    Attributes
    ----------
    size
        How many numbers there are.
    """

    def __init__(self, tree: Any, axes: int):
        arrays = eqx.filter(
            tree, lambda leaf: isinstance(leaf, jax.ShapeDtypeStruct) or eqx.is_array(leaf)
        )
        leaves, self._structure = jax.tree.flatten(arrays)
        self._axes = axes
        self._shapes = [leaf.shape[axes:] for leaf in leaves]
        self.size = sum(int(np.prod(shape, dtype=int)) for shape in self._shapes)

    def packed(self, tree: Any) -> jax.Array:
        """Return a tree as one array."""
        leaves = jax.tree.leaves(eqx.filter(tree, eqx.is_array))
        flat = [jnp.asarray(leaf, float).reshape(*leaf.shape[: self._axes], -1) for leaf in leaves]
        return jnp.concatenate(flat, axis=-1)

    def tree(self, values: Sequence[Any]) -> Any:
        """Return the tree of values that follow one another."""
        leaves, place = [], 0
        for shape in self._shapes:
            leaf = np.empty(shape, object)
            for at in np.ndindex(shape):
                leaf[at] = values[place]
                place += 1
            leaves.append(leaf)
        return jax.tree.unflatten(self._structure, leaves)
