"""Anisotropic mobility of the chains."""

from discover.effects.base import ConstitutiveEffect, EffectParameter
from tensor_library.algebra import square
from tensor_library.law_terms import LawTerm


class GiesekusMobility(ConstitutiveEffect):
    """Adds α σ·σ   [Giesekus 1982, JNNFM 11, 69]."""

    def extra_term(self, values, stress, rate):
        """Return α σ·σ."""
        del rate
        return values[0] * square(stress)

    def as_terms(self, values):
        """Return α σ·σ."""
        return (LawTerm("sigma.sigma", values[0]),)


EFFECT = GiesekusMobility(
    name="giesekus_mobility",
    parameters=(
        EffectParameter(
            "alpha",
            r"\alpha",
            low=0.0,
            high=1.0,
            first_trial=0.01,
            range_source="Giesekus 1982: a mobility that no stress can make negative",
        ),
    ),
    equation=r"h \mathrel{+}= \alpha\,\sigma\cdot\sigma",
    source="Giesekus 1982, J. Non-Newtonian Fluid Mech. 11, 69",
    check="Measure N2 at low rates: N2/N1 should be near −α/2.",
    visible="alpha of about 0.05 at a Weissenberg number of 1.",
)
