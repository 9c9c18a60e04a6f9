"""Algebra of symmetric tensors, (3, 3) for any flow or the four components of simple shear.

Traces, squares and anticommutators keep tensors symmetric; laws written with them work on both, and
on four components they compile to far less than matrix products.
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
    >>> float(trace(jnp.array([2.0, 1.0, 0.0, 5.0])))
    3.0
    """
    if _is_shear(tensor):
        return tensor[0] + tensor[1] + tensor[2]
    return jnp.trace(tensor)


def square(tensor: Symmetric) -> Symmetric:
    """Return a·a.

    Examples
    --------
    >>> square(jnp.diag(jnp.array([2.0, 0.0, 0.0])))[0].tolist()
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
    >>> anticommutator(jnp.array([2.0, 0.0, 0.0, 0.0]), jnp.array([0.0, 0.0, 0.0, 3.0])).tolist()
    [0.0, 0.0, 0.0, 6.0]
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
    >>> float(inner(jnp.array([2.0, 0.0, 0.0, 1.0]), jnp.array([2.0, 0.0, 0.0, 1.0])))
    6.0
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
    >>> to_shear(jnp.diag(jnp.array([2.0, 0.0, 0.0]))).tolist()
    [2.0, 0.0, 0.0, 0.0]
    """
    return jnp.stack([tensor[0, 0], tensor[1, 1], tensor[2, 2], tensor[0, 1]])


def from_shear(components: Float[Array, "4"]) -> Float[Array, "3 3"]:
    """Return the full tensor of four simple-shear components (11, 22, 33, 12).

    Examples
    --------
    >>> from_shear(jnp.array([1.0, 2.0, 3.0, 4.0])).tolist()
    [[1.0, 4.0, 0.0], [4.0, 2.0, 0.0], [0.0, 0.0, 3.0]]
    """
    a11, a22, a33, a12 = components
    zero = jnp.zeros_like(a11)
    return jnp.stack(
        [jnp.stack([a11, a12, zero]), jnp.stack([a12, a22, zero]), jnp.stack([zero, zero, a33])]
    )


def contracted(first: Float[Array, "..."], second: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return Σᵢ first[…, i] second[i, …], as `jnp.tensordot` with `axes=1` does.

    No product of matrices stands in it, which XLA would start by itself at every step of a loop.
    """
    columns = (1,) * (second.ndim - 1)
    return jnp.sum(first.reshape(first.shape + columns) * second, axis=first.ndim - 1)


SHEAR_COMPONENTS = ("11", "22", "33", "12")
"""Order of the four components that live in simple shear."""


INVARIANT_NAMES = (
    "tr(sigma)",
    "tr(sigma.sigma)",
    "tr(gammadot.gammadot)",
    "tr(sigma.sigma.sigma)",
    "tr(gammadot.gammadot.gammadot)",
    "tr(sigma.sigma.gammadot)",
    "tr(sigma.gammadot.gammadot)",
    "tr(sigma.gammadot)",
)
"""Canonical spellings, in the order of `scalar_invariants`."""

INVARIANT_ORDERS = (1, 2, 2, 3, 3, 3, 3, 2)
"""Number of tensors multiplied in each invariant; used as a measure of complexity."""

IDENTICALLY_ZERO_IN_SHEAR = (4,)
"""Indices of invariants that vanish in every simple shear flow: tr γ̇³ = 0."""


def scalar_invariants(stress: Symmetric, rate: Symmetric) -> Float[Array, "8"]:
    """Return the invariants of two symmetric tensors, (3, 3) or (4,), named in `INVARIANT_NAMES`.

    Eight of Smith's ten [Smith 1971, IJES 9, 899]: tr γ̇ vanishes at constant volume; tr σ²γ̇²
    follows from the others in simple shear, but not in a general flow.

    Examples
    --------
    >>> scalar_invariants(jnp.array([2.0, 0.0, 0.0, 0.0]), jnp.zeros(4))[:2].tolist()  # tr σ, tr σ²
    [2.0, 4.0]
    """
    stress_squared = square(stress)
    rate_squared = square(rate)
    return jnp.stack(
        [
            trace(stress),
            trace(stress_squared),
            trace(rate_squared),
            inner(stress_squared, stress),
            inner(rate_squared, rate),
            inner(stress_squared, rate),
            inner(stress, rate_squared),
            inner(stress, rate),
        ]
    )


TENSOR_NAMES = (
    "I",
    "sigma",
    "gammadot",
    "sigma.sigma",
    "gammadot.gammadot",
    "sigma.gammadot+gammadot.sigma",
    "sigma.sigma.gammadot+gammadot.sigma.sigma",
    "sigma.gammadot.gammadot+gammadot.gammadot.sigma",
)
"""Canonical spellings, in the order of `integrity_basis`."""

TENSOR_ORDERS = (0, 1, 1, 2, 2, 2, 3, 3)
"""Number of tensors multiplied in each; used as a measure of complexity."""


def integrity_basis(
    stress: Symmetric, rate: Symmetric
) -> Float[Array, "8 3 3"] | Float[Array, "8 4"]:
    """Return I, σ, γ̇, σ², γ̇², σγ̇+γ̇σ, σ²γ̇+γ̇σ², σγ̇²+γ̇²σ [Smith 1971, IJES 9, 899].

    Any isotropic symmetric function of two symmetric tensors is a sum of these with coefficients in
    the ten invariants.

    Examples
    --------
    >>> integrity_basis(jnp.zeros(4), jnp.zeros(4)).shape
    (8, 4)
    """
    stress_squared = square(stress)
    rate_squared = square(rate)
    return jnp.stack(
        [
            identity_like(stress),
            stress,
            rate,
            stress_squared,
            rate_squared,
            anticommutator(stress, rate),
            anticommutator(stress_squared, rate),
            anticommutator(stress, rate_squared),
        ]
    )
