"""A product of small arrays as a sum of products, for what is done at every step of a loop.

XLA starts a product of matrices as a call of its own. One such call in the body of a loop keeps the
compiler from making the whole loop one piece of machine code, and each step then costs ten times as
much as its arithmetic: a term of the library at a given stress 57 ms for 6 ms. On arrays of a few
numbers a sum of products costs no more than the call would.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float


def contracted(first: Float[Array, "..."], second: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return Σᵢ first[…, i] second[i, …], as `jnp.tensordot` with `axes=1` does.

    Parameters
    ----------
    first, second
        The last axis of the one and the first of the other are as long.
    """
    columns = (1,) * (second.ndim - 1)
    return jnp.sum(first.reshape(first.shape + columns) * second, axis=first.ndim - 1)
