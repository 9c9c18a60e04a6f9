"""Constants of a law that differ from mode to mode, as smooth functions of the relaxation time."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

DEGREE = 2
"""Highest degree of the polynomial in log λ."""

LARGEST = 10.0
"""Largest coefficient, and largest deviation of one mode, on the link's scale: e^10 either way."""


def decades(
    modulus: Float[Array, " k"],
    relaxation_time: Float[Array, " k"],
    of: Float[Array, " m"] | None = None,
    beyond: bool = False,
) -> Float[Array, " m"]:
    """Return log10(λ/λ̄), with λ̄ the geometric mean of the times by viscosity.

    `modulus`, `relaxation_time`: of the declared modes, in Pa and s. `of`: times in s; by default
    the declared ones. Beyond these the end counts, for a polynomial says nothing there. `beyond`:
    whether times beyond the declared ones count as they are: of modes by which a polynomial is
    told, too.
    """
    own = jnp.log10(relaxation_time)
    viscosity = modulus * relaxation_time
    asked = own if of is None else jnp.log10(of)
    if not beyond:
        asked = jnp.clip(asked, jnp.min(own), jnp.max(own))
    return asked - jnp.sum(viscosity * own) / jnp.sum(viscosity)


def constants_of_modes(
    mean: Float[Array, ""],
    low: float,
    high: float,
    coefficients: Float[Array, " degree"],
    deviations: Float[Array, " k"],
    places: Float[Array, " k"],
) -> Float[Array, " k"]:
    """Return the constant of each mode: that at λ̄, with its link moved by a polynomial.

    The link is the logarithm of (c − low)/(high − c), or of c − low where there is no upper bound:
    so every mode keeps the range in which the law is one, whatever the coefficients. With all of
    them zero each mode has the very constant of the mean.

    `mean`: the constant at λ̄, dimensionless. `low`, `high`: its range. `coefficients`: of the
    first and the second power of `places`. `deviations`: of each mode from the polynomial.
    `places`: of the modes, from `decades`.
    """
    powers = jnp.stack([places ** (i + 1) for i in range(DEGREE)])
    change = coefficients @ powers + deviations
    if not np.isfinite(low):
        # mirrored where only the upper bound is one, and no link where neither is
        return mean + change if not np.isfinite(high) else high - (high - mean) * jnp.exp(-change)
    if not np.isfinite(high):
        return low + (mean - low) * jnp.exp(change)
    share, odds = (mean - low) / (high - low), jnp.exp(change)
    return low + (high - low) * share * odds / (1.0 - share + share * odds)
