"""A product of small arrays as a sum of products, for what is done at every step of a loop.

XLA starts a product of matrices as a call of its own. One such call in the body of a loop keeps the
compiler from making the whole loop one piece of machine code, and where arrays hold a few numbers
each step then costs ten times as much as its arithmetic: a prediction of creep with all candidates
of a loop 57 ms instead of 6. On arrays of some fifty numbers both cost the same, and beyond that
the call is faster.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float


def contracted(
    first: Float[Array, "..."], second: Float[Array, "..."], in_one_piece: bool = True
) -> Float[Array, "..."]:
    """Return Σᵢ first[…, i] second[i, …], as `jnp.tensordot` with `axes=1` does.

    `first`, `second`: the last axis of the one and the first of the other are as long.
    `in_one_piece`: whether no product of matrices is to stand in the loop.
    """
    if not in_one_piece:
        return jnp.tensordot(first, second, axes=1)
    columns = (1,) * (second.ndim - 1)
    return jnp.sum(first.reshape(first.shape + columns) * second, axis=first.ndim - 1)
