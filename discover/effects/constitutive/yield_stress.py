"""A stress below which nothing flows."""

import jax.numpy as jnp

from discover.effects.base import ConstitutiveEffect, EffectParameter
from tensor_library.algebra import inner, trace

_TINY = 1e-12


class YieldStress(ConstitutiveEffect):
    """Lets only the stress beyond yield relax   [Saramito 2007, JNNFM 145, 1].

    Relaxation carries the factor max(0, 1 − Y/|σ_d|), where |σ_d| is the size of the deviator,
    √(σ_d:σ_d/2): below yield a mode is an elastic solid.
    """

    def extra_term(self, values, stress, rate):
        """Return −min(1, Y/|σ_d|) σ."""
        del rate
        squared = 0.5 * (inner(stress, stress) - trace(stress) ** 2 / 3.0)
        size = jnp.sqrt(jnp.maximum(squared, _TINY**2))
        return -jnp.minimum(1.0, values[0] / size) * stress


EFFECT = YieldStress(
    name="yield_stress",
    parameters=(
        EffectParameter(
            "yield_strain",
            "Y",
            low=0.0,
            high=10.0,
            first_trial=0.01,
            range_source="Bonn et al. 2017, Rev. Mod. Phys. 89, 035005: soft solids yield at "
            "strains of 0.001 to 1, elastic gels at a few",
        ),
    ),
    equation=(
        r"h \mathrel{-}= \min\left(1, \frac{Y}{|\sigma_d|}\right)\sigma,"
        r"\quad \sigma_\mathrm{y} = Y\,G"
    ),
    source="Saramito 2007, J. Non-Newtonian Fluid Mech. 145, 1",
    check="Creep below and above Y times the modulus: only above it should flow go on.",
    visible="Y of about 5 % of the dimensionless stress.",
    complexity=2,
)
