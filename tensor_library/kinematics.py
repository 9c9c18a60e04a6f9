"""Kinematics of homogeneous flows.

A velocity gradient is the scalar shear rate; the four components (L11, L22, L33, L12) of a flow
whose third axis is principal; or the full (3, 3) tensor.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from tensor_library.algebra import Symmetric

VelocityGradient = Float[Array, "3 3"] | Float[Array, "4"] | Float[Array, ""]


def simple_shear(shear_rate: Float[Array, ""]) -> Float[Array, "3 3"]:
    """Return the velocity gradient of v₁ = γ̇ x₂.

    Examples
    --------
    >>> simple_shear(jnp.asarray(2.0))[0].tolist()
    [0.0, 2.0, 0.0]
    """
    return jnp.zeros((3, 3), dtype=jnp.result_type(shear_rate, float)).at[0, 1].set(shear_rate)


def uniaxial_extension(extension_rate: Float[Array, ""]) -> Float[Array, "3 3"]:
    """Return the velocity gradient of uniaxial extension along x₁ at constant volume.

    Examples
    --------
    >>> jnp.diag(uniaxial_extension(jnp.asarray(2.0))).tolist()
    [2.0, -1.0, -1.0]
    """
    return extension_rate * jnp.diag(jnp.array([1.0, -0.5, -0.5]))


def planar_extension(extension_rate: Float[Array, ""]) -> Float[Array, "3 3"]:
    """Return the velocity gradient of planar extension in the x₁ x₂ plane.

    Examples
    --------
    >>> jnp.diag(planar_extension(jnp.asarray(2.0))).tolist()
    [2.0, -2.0, 0.0]
    """
    return extension_rate * jnp.diag(jnp.array([1.0, -1.0, 0.0]))


def rate_of_deformation(velocity_gradient: VelocityGradient) -> Symmetric:
    """Return γ̇ = L + Lᵀ, of L in any of its three forms, in 1/s or dimensionless.

    Examples
    --------
    >>> rate_of_deformation(jnp.asarray(2.0)).tolist()  # of simple shear: 11, 22, 33, 12
    [0.0, 0.0, 0.0, 2.0]
    """
    velocity_gradient = jnp.asarray(velocity_gradient)
    if velocity_gradient.shape == ():
        zero = jnp.zeros_like(velocity_gradient)
        return jnp.stack([zero, zero, zero, velocity_gradient])
    if velocity_gradient.shape == (4,):
        return velocity_gradient * jnp.array([2.0, 2.0, 2.0, 1.0])
    return velocity_gradient + velocity_gradient.T


def upper_convected_production(stress: Symmetric, velocity_gradient: VelocityGradient) -> Symmetric:
    """Return L·σ + σ·Lᵀ, what the upper convected derivative subtracts from dσ/dt [Oldroyd 1950].

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
        return jnp.stack(
            [2.0 * velocity_gradient * stress[3], zero, zero, velocity_gradient * stress[1]]
        )
    if velocity_gradient.shape == (4,):
        l11, l22, l33, l12 = velocity_gradient
        s11, s22, s33, s12 = stress
        return jnp.stack(
            [
                2.0 * (l11 * s11 + l12 * s12),
                2.0 * l22 * s22,
                2.0 * l33 * s33,
                (l11 + l22) * s12 + l12 * s22,
            ]
        )
    product = velocity_gradient @ stress
    return product + product.T
