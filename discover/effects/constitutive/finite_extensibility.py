"""Chains that cannot be stretched without end."""

from discover.effects.base import ConstitutiveEffect, EffectParameter
from discover.laws.textbook.fene_p import fene_p_terms
from tensor_library.algebra import identity_like, inner, trace


class FiniteExtensibility(ConstitutiveEffect):
    """Turns the Maxwell law into FENE-P   [Bird, Dotson & Johnson 1980, JNNFM 7, 213].

    In stress form, with q = 1/L² and the springs' factor f = 1 + q tr σ; see
    `discover.laws.FenePeterlin`, whose term this is with 1 − q tr A = (1 − 3q)/f put in. Its rate
    comes from the elimination of the conformation A, whose own equation names none beside the
    convected derivative, so the law stays well-posed in fast flow.
    """

    def extra_term(self, values, stress, rate):
        """Return q tr(σ) σ − q (tr(σ·γ̇) − f tr σ)(σ + I)/(1 − 3q)."""
        inverse = values[0]
        stretch = trace(stress)
        factor = 1.0 + inverse * stretch
        growth = inverse * (inner(stress, rate) - factor * stretch) / (1.0 - 3.0 * inverse)
        return inverse * stretch * stress - growth * (stress + identity_like(stress))

    def as_terms(self, values):
        """Return the six terms of FENE-P."""
        return fene_p_terms(values[0])


EFFECT = FiniteExtensibility(
    name="finite_extensibility",
    parameters=(
        EffectParameter(
            "q",
            "q",
            low=0.0,
            high=0.3,
            first_trial=0.005,
            range_source="Bird, Dotson & Johnson 1980: a chain at rest has L² = 3 already, so that "
            "q is below 1/3",
        ),
    ),
    equation=(
        r"h \mathrel{+}= q\,\mathrm{tr}(\sigma)\,\sigma - \frac{q}{1 - 3q}"
        r"\left[\mathrm{tr}(\sigma\cdot\dot\gamma) - (1 + q\,\mathrm{tr}\,\sigma)\,"
        r"\mathrm{tr}\,\sigma\right](\sigma + I),\quad q = 1/L^2"
    ),
    source="Bird, Dotson & Johnson 1980, J. Non-Newtonian Fluid Mech. 7, 213 (FENE-P)",
    check="Measure uniaxial extension: the viscosity should level off; N2 should be zero.",
    visible="q of about 0.02 at a Weissenberg number of 1, less in faster flow.",
    complexity=2,
)
