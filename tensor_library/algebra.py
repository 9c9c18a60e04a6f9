"""Algebra of symmetric tensors, in full and in simple shear.

Everything the integrity basis needs is a trace, a square or an anticommutator, and those keep
symmetric tensors symmetric. Written over these few operations, a constitutive law works on a
full ``(3, 3)`` tensor for any homogeneous flow and on the ``(4,)`` components of simple shear,
where the element-wise formulas compile to far less work than matrix products.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

Symmetric = Float[Array, "3 3"] | Float[Array, "4"]


def _is_shear(tensor: Symmetric) -> bool:
    if tensor.shape == (4,):
        return True
    if tensor.shape == (3, 3):
        return False
    raise ValueError(
        "A symmetric tensor must have shape (3, 3), or (4,) in simple shear; got "
        f"{tensor.shape}. Use jax.vmap to work on a batch."
    )


def identity_like(tensor: Symmetric) -> Symmetric:
    """Return the unit tensor in the storage of `tensor`.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> from tensor_library import identity_like
    >>> identity_like(jnp.zeros(4)).tolist()  # 11, 22, 33, 12
    [1.0, 1.0, 1.0, 0.0]
    """
    if _is_shear(tensor):
        return jnp.array([1.0, 1.0, 1.0, 0.0], dtype=tensor.dtype)
    return jnp.eye(3, dtype=tensor.dtype)


def trace(tensor: Symmetric) -> Float[Array, ""]:
    """Return tr a.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> from tensor_library import trace
    >>> sigma = jnp.diag(jnp.asarray([2.0, 0.0, 0.0]))
    >>> float(trace(sigma))
    2.0
    """
    if _is_shear(tensor):
        return tensor[0] + tensor[1] + tensor[2]
    return jnp.trace(tensor)


def square(tensor: Symmetric) -> Symmetric:
    """Return a·a.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> from tensor_library import square
    >>> sigma = jnp.diag(jnp.asarray([2.0, 0.0, 0.0]))
    >>> square(sigma)[0].tolist()
    [4.0, 0.0, 0.0]
    """
    if _is_shear(tensor):
        a11, a22, a33, a12 = tensor
        return jnp.stack([a11**2 + a12**2, a22**2 + a12**2, a33**2, a12 * (a11 + a22)])
    return tensor @ tensor


def anticommutator(first: Symmetric, second: Symmetric) -> Symmetric:
    """Return a·b + b·a, which is symmetric although a·b is not.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> from tensor_library import anticommutator
    >>> sigma = jnp.diag(jnp.asarray([2.0, 0.0, 0.0]))
    >>> anticommutator(sigma, sigma)[0].tolist()
    [8.0, 0.0, 0.0]
    """
    if _is_shear(first):
        a11, a22, a33, a12 = first
        b11, b22, b33, b12 = second
        return jnp.stack(
            [
                2.0 * (a11 * b11 + a12 * b12),
                2.0 * (a22 * b22 + a12 * b12),
                2.0 * a33 * b33,
                a12 * (b11 + b22) + b12 * (a11 + a22),
            ]
        )
    product = first @ second
    return product + product.T


def inner(first: Symmetric, second: Symmetric) -> Float[Array, ""]:
    """Return tr(a·b).

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> from tensor_library import inner
    >>> sigma = jnp.diag(jnp.asarray([2.0, 0.0, 0.0]))
    >>> float(inner(sigma, sigma))
    4.0
    """
    if _is_shear(first):
        # the 12 component stands for 12 and 21
        a11, a22, a33, a12 = first
        b11, b22, b33, b12 = second
        return a11 * b11 + a22 * b22 + a33 * b33 + 2.0 * a12 * b12
    return jnp.sum(first * second)


def to_shear(tensor: Float[Array, "3 3"]) -> Float[Array, "4"]:
    """Return the four components (11, 22, 33, 12) of a tensor in simple shear.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> from tensor_library import to_shear
    >>> sigma = jnp.diag(jnp.asarray([2.0, 0.0, 0.0]))
    >>> to_shear(sigma).tolist()
    [2.0, 0.0, 0.0, 0.0]
    """
    return jnp.stack([tensor[0, 0], tensor[1, 1], tensor[2, 2], tensor[0, 1]])


def from_shear(components: Float[Array, "4"]) -> Float[Array, "3 3"]:
    """Return the full tensor of four simple-shear components (11, 22, 33, 12).

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> from tensor_library import from_shear
    >>> from_shear(jnp.asarray([1.0, 2.0, 3.0, 4.0])).tolist()
    [[1.0, 4.0, 0.0], [4.0, 2.0, 0.0], [0.0, 0.0, 3.0]]
    """
    a11, a22, a33, a12 = components
    zero = jnp.zeros_like(a11)
    return jnp.stack(
        [jnp.stack([a11, a12, zero]), jnp.stack([a12, a22, zero]), jnp.stack([zero, zero, a33])]
    )
