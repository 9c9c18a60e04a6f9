"""Arrays of the host as JAX's, without a program for each shape."""

import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array


def on_device(values: ArrayLike) -> Array:
    """Return an array of NumPy's as one of JAX's; one of JAX's stays as it is.

    Told no type, `jax.numpy.asarray` compiles a copy for every new shape, some 10 ms each; told the
    one that the array has, it only copies.
    """
    if isinstance(values, np.ndarray):
        return jnp.asarray(values, values.dtype)
    return jnp.asarray(values)
