"""Loss of network junctions that grows exponentially with their stretch."""

import jax.numpy as jnp

from discover.effects.base import ConstitutiveEffect, EffectParameter
from tensor_library.algebra import trace
from tensor_library.law_terms import LawTerm


class ExponentialNetworkLoss(ConstitutiveEffect):
    """Adds (exp(ε tr σ) − 1) σ   [Phan-Thien 1978, J. Rheol. 22, 259]."""

    def extra_term(self, values, stress, rate):
        """Return (exp(ε tr σ) − 1) σ."""
        del rate
        # beyond exp(60) a trial is absurd; the cap keeps it finite, to be rejected for its misfit
        return jnp.expm1(jnp.minimum(values[0] * trace(stress), 60.0)) * stress

    def as_terms(self, values):
        """Return (exp(ε tr σ) − 1) σ."""
        return (LawTerm("(exp(epsilon*tr(sigma))-1)*sigma", 1.0, {"epsilon": values[0]}),)


EFFECT = ExponentialNetworkLoss(
    name="ptt_exponential",
    parameters=(
        EffectParameter(
            "epsilon",
            r"\varepsilon",
            low=0.0,
            high=10.0,
            first_trial=0.01,
            range_source="Phan-Thien & Tanner 1977: fast extension of linear PTT ends at "
            "2 Gλ/ε, which ten puts to a fifteenth of Trouton's 3 Gλ; fluids have 0.01 to 1",
        ),
    ),
    equation=r"h \mathrel{+}= (e^{\varepsilon\,\mathrm{tr}\,\sigma} - 1)\,\sigma",
    source="Phan-Thien 1978, J. Rheol. 22, 259",
    check="Measure uniaxial extension: the viscosity should pass a maximum; N2 should be zero.",
    visible="epsilon of about 0.03 at a Weissenberg number of 1.",
    complexity=2,
)
