"""Algebra and kinematics of symmetric tensors, (3, 3) or the four components of simple shear.

On four components laws compile to far less than matrix products.

Examples
--------
>>> first, second = jnp.array([2.0, 0.0, 0.0, 0.0]), jnp.array([0.0, 0.0, 0.0, 3.0])
>>> identity_like(first).tolist(), anticommutator(first, second).tolist()  # 11, 22, 33, 12
([1.0, 1.0, 1.0, 0.0], [0.0, 0.0, 0.0, 6.0])
>>> float(trace(square(first))), float(inner(second, second))
(4.0, 18.0)
>>> rate_of_deformation(jnp.asarray(2.0)).tolist()  # of simple shear
[0.0, 0.0, 0.0, 2.0]
>>> scalar_invariants(first, second)[:2].tolist(), integrity_basis(first, second).shape
([2.0, 4.0], (8, 4))
>>> upper_convected_production(second, jnp.asarray(2.0)).tolist()  # σ11 grows with 2 γ̇ σ12
[12.0, 0.0, 0.0, 0.0]
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
    """Return the unit tensor in the storage of `tensor`."""
    if _is_shear(tensor):
        return jnp.array([1.0, 1.0, 1.0, 0.0], dtype=tensor.dtype)
    return jnp.eye(3, dtype=tensor.dtype)


def trace(tensor: Symmetric) -> Float[Array, ""]:
    """Return tr a."""
    if _is_shear(tensor):
        return tensor[0] + tensor[1] + tensor[2]
    return jnp.trace(tensor)


def square(tensor: Symmetric) -> Symmetric:
    """Return a·a."""
    if _is_shear(tensor):
        a11, a22, a33, a12 = tensor
        return jnp.stack([a11**2 + a12**2, a22**2 + a12**2, a33**2, a12 * (a11 + a22)])
    return tensor @ tensor


def anticommutator(first: Symmetric, second: Symmetric) -> Symmetric:
    """Return a·b + b·a, which is symmetric although a·b is not."""
    if _is_shear(first):
        a11, a22, a33, a12 = first
        b11, b22, b33, b12 = second
        twice = 2.0 * (a11 * b11 + a12 * b12), 2.0 * (a22 * b22 + a12 * b12), 2.0 * a33 * b33
        return jnp.stack([*twice, a12 * (b11 + b22) + b12 * (a11 + a22)])
    product = first @ second
    return product + product.T


def inner(first: Symmetric, second: Symmetric) -> Float[Array, ""]:
    """Return tr(a·b)."""
    if _is_shear(first):
        # the 12 component stands for 12 and 21
        a11, a22, a33, a12 = first
        b11, b22, b33, b12 = second
        return a11 * b11 + a22 * b22 + a33 * b33 + 2.0 * a12 * b12
    return jnp.sum(first * second)


def contracted(first: Float[Array, "..."], second: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return Σᵢ first[…, i] second[i, …] without a product of matrices, which XLA starts apart."""
    columns = (1,) * (second.ndim - 1)
    return jnp.sum(first.reshape(first.shape + columns) * second, axis=first.ndim - 1)


INVARIANT_NAMES = (
    "tr(sigma)", "tr(sigma.sigma)", "tr(gammadot.gammadot)", "tr(sigma.sigma.sigma)",
    "tr(gammadot.gammadot.gammadot)", "tr(sigma.sigma.gammadot)", "tr(sigma.gammadot.gammadot)",
    "tr(sigma.gammadot)",
)  # fmt: skip
"""Canonical spellings, in the order of `scalar_invariants`."""

INVARIANT_ORDERS = (1, 2, 2, 3, 3, 3, 3, 2)
"""Number of tensors multiplied in each invariant; used as a measure of complexity."""

IDENTICALLY_ZERO_IN_SHEAR = (4,)
"""Indices of invariants that vanish in every simple shear flow: tr γ̇³ = 0."""


def scalar_invariants(stress: Symmetric, rate: Symmetric) -> Float[Array, "8"]:
    """Return the `INVARIANT_NAMES` of two symmetric tensors, (3, 3) or (4,).

    Eight of Smith's ten [Smith 1971, IJES 9, 899]: tr γ̇ vanishes at constant volume, and tr σ²γ̇²
    follows from the others in simple shear alone.
    """
    stress_squared, rate_squared = square(stress), square(rate)
    return jnp.stack([
        trace(stress), trace(stress_squared), trace(rate_squared),
        inner(stress_squared, stress), inner(rate_squared, rate),
        inner(stress_squared, rate), inner(stress, rate_squared), inner(stress, rate),
    ])  # fmt: skip


TENSOR_NAMES = (
    "I", "sigma", "gammadot", "sigma.sigma", "gammadot.gammadot", "sigma.gammadot+gammadot.sigma",
    "sigma.sigma.gammadot+gammadot.sigma.sigma", "sigma.gammadot.gammadot+gammadot.gammadot.sigma",
)  # fmt: skip
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
    stress_squared, rate_squared = square(stress), square(rate)
    return jnp.stack([
        identity_like(stress), stress, rate, stress_squared, rate_squared,
        anticommutator(stress, rate), anticommutator(stress_squared, rate),
        anticommutator(stress, rate_squared),
    ])  # fmt: skip


VelocityGradient = Float[Array, "3 3"] | Float[Array, "4"] | Float[Array, ""]
"""L in 1/s: full; (L11, L22, L33, L12) where the third axis is principal; or a shear rate."""


def rate_of_deformation(velocity_gradient: VelocityGradient) -> Symmetric:
    """Return γ̇ = L + Lᵀ, of L in any of its three forms, in 1/s or dimensionless."""
    velocity_gradient = jnp.asarray(velocity_gradient)
    if velocity_gradient.shape == ():
        zero = jnp.zeros_like(velocity_gradient)
        return jnp.stack([zero, zero, zero, velocity_gradient])
    if velocity_gradient.shape == (4,):
        return velocity_gradient * jnp.array([2.0, 2.0, 2.0, 1.0])
    return velocity_gradient + velocity_gradient.T


def upper_convected_production(stress: Symmetric, velocity_gradient: VelocityGradient) -> Symmetric:
    """Return L·σ + σ·Lᵀ, what the upper-convected derivative subtracts from dσ/dt [Oldroyd 1950].

    `stress`: (3, 3) with a full L, else four components with (4,) or () of L.

    Examples
    --------
    >>> stress, rate = jnp.array([0.0, 0.0, 0.0, 3.0]), jnp.asarray(2.0)
    >>> upper_convected_production(stress, rate).tolist()  # σ11 grows with 2 γ̇ σ12
    [12.0, 0.0, 0.0, 0.0]
    """
    velocity_gradient = jnp.asarray(velocity_gradient)
    if velocity_gradient.shape == ():
        zero = jnp.zeros_like(stress[0])
        grown = 2.0 * velocity_gradient * stress[3], velocity_gradient * stress[1]
        return jnp.stack([grown[0], zero, zero, grown[1]])
    if velocity_gradient.shape == (4,):
        l11, l22, l33, l12 = velocity_gradient
        s11, s22, s33, s12 = stress
        twice = 2.0 * (l11 * s11 + l12 * s12), 2.0 * l22 * s22, 2.0 * l33 * s33
        return jnp.stack([*twice, (l11 + l22) * s12 + l12 * s22])
    product = velocity_gradient @ stress
    return product + product.T
