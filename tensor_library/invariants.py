"""Eight of the scalar invariants of stress and rate of deformation."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from tensor_library.algebra import Symmetric, inner, square, trace

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
    """Return the invariants of two symmetric tensors named in `INVARIANT_NAMES`.

    Smith's list has ten for two symmetric tensors   [Smith 1971, IJES 9, 899]. Two are left out:
    tr γ̇, which vanishes in an incompressible flow, and tr σ²γ̇², which in simple shear follows from
    the others. In a general flow it does not follow, so a law in these eight is not the most
    general one there.

    Parameters
    ----------
    stress, rate
        Symmetric dimensionless tensors, both of shape (3, 3) or both (4,).

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> from tensor_library import scalar_invariants
    >>> sigma = jnp.diag(jnp.asarray([2.0, 0.0, 0.0]))
    >>> scalar_invariants(sigma, jnp.zeros((3, 3)))[:2].tolist()  # tr σ, tr σ²
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
