"""Constants of a law that differ from mode to mode, as a power of the relaxation time."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from discover.effects.base import ConstitutiveEffect, EffectParameter


class ModeDependence(ConstitutiveEffect):
    """The extra term of mode k carries the factor (λ_k/λ̄)^p, with λ̄ the mean time by viscosity.

    The simplest smooth function of the relaxation time that is never negative. It has no name in
    the dictionary, because it is no mechanism.
    """

    def factors(
        self,
        values: Float[Array, " p"],
        modulus: Float[Array, " k"],
        relaxation_time: Float[Array, " k"],
    ) -> Float[Array, " k"]:
        """Return the factor of each mode; moduli in Pa, times in s."""
        viscosity = modulus * relaxation_time
        logarithm = jnp.log(relaxation_time)
        mean = jnp.sum(viscosity * logarithm) / jnp.sum(viscosity)
        return jnp.exp(values[0] * (logarithm - mean))


BY_MODE = ModeDependence(
    name="mode_dependence",
    parameters=(
        EffectParameter(
            "exponent",
            "p",
            low=-2.0,
            high=2.0,
            first_trial=0.1,
            range_source="constants of Giesekus or PTT laws fitted mode by mode differ by a factor "
            "of ten or so over a decade of times (Larson 1988, Constitutive Equations, ch. 7)",
        ),
    ),
    equation=r"h_k \to \left(\frac{\lambda_k}{\bar\lambda}\right)^p h_k",
    source="Larson 1988, Constitutive Equations for Polymer Melts and Solutions, ch. 7",
    check="Fit the law to flows of quite different rates, each alone.",
)
