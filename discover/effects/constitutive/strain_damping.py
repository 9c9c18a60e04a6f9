"""Strands of a network that strain takes away for good."""

import jax.numpy as jnp

from discover.effects.base import ConstitutiveEffect, EffectParameter
from tensor_library.algebra import identity_like, inner

_AT_REST = 1e-300
"""Below any |γ̇|² that matters: the root has no derivative at zero."""


class StrainDamping(ConstitutiveEffect):
    """Adds n λ|γ̇| (σ + I), with |γ̇|² = ½ γ̇:γ̇.

    Of the strands that carry stress, e^{−nγ} are left after a strain γ. Where the flow does not
    turn that is the K-BKZ law with Wagner's damping function exactly   [Wagner 1976, Rheol. Acta
    15, 136]. Where it does, strain is added up without regard to its sign: a strand that was lost
    does not come back   [after Wagner & Stephenson 1979, J. Rheol. 23, 489, who take the smallest
    damping since].
    """

    def extra_term(self, values, stress, rate):
        """Return n λ|γ̇| (σ + I)."""
        size = jnp.sqrt(jnp.maximum(0.5 * inner(rate, rate), _AT_REST))
        return values[0] * size * (stress + identity_like(stress))


EFFECT = StrainDamping(
    name="strain_damping",
    parameters=(
        EffectParameter(
            "n",
            "n",
            low=0.0,
            high=10.0,
            first_trial=0.02,
            range_source="a strain of 1/n takes the strands, and networks of chains are linear up "
            "to 10 % (Treloar 1975, The Physics of Rubber Elasticity, ch. 5); melts have 0.1 to "
            "0.4 (Wagner 1976)",
        ),
    ),
    equation=r"h \mathrel{+}= n\,\lambda|\dot\gamma|\,(\sigma + I)",
    source="Wagner 1976, Rheol. Acta 15, 136; Wagner & Stephenson 1979, J. Rheol. 23, 489",
    check="Step the strain: the relaxation curves should differ by a factor e^{−nγ} alone.",
    visible="n times the strain within a relaxation time of about 0.05.",
    explicit_rate=True,
)
