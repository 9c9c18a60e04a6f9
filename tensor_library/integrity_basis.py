"""The eight tensors in which an isotropic function of stress and rate can be written."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from tensor_library.algebra import Symmetric, anticommutator, identity_like, square

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
    """Return I, σ, γ̇, σ², γ̇², σγ̇+γ̇σ, σ²γ̇+γ̇σ², σγ̇²+γ̇²σ   [Smith 1971, IJES 9, 899].

    Any isotropic symmetric tensor function of two symmetric tensors is a sum of these with
    coefficients that depend on the ten invariants of the two alone, so a law written in them does
    not depend on the observer. `scalar_invariants` has eight of the ten.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> from tensor_library import integrity_basis
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
