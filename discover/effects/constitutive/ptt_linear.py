"""Loss of network junctions in proportion to their stretch."""

from discover.effects.base import ConstitutiveEffect, EffectParameter
from tensor_library.algebra import trace
from tensor_library.law_terms import LawTerm


class LinearNetworkLoss(ConstitutiveEffect):
    """Adds ε tr(σ) σ   [Phan-Thien & Tanner 1977, JNNFM 2, 353]."""

    def extra_term(self, values, stress, rate):
        """Return ε tr(σ) σ."""
        del rate
        return values[0] * trace(stress) * stress

    def as_terms(self, values):
        """Return ε tr(σ) σ."""
        return (LawTerm("tr(sigma)*sigma", values[0]),)


EFFECT = LinearNetworkLoss(
    name="ptt_linear",
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
    equation=r"h \mathrel{+}= \varepsilon\,\mathrm{tr}(\sigma)\,\sigma",
    source="Phan-Thien & Tanner 1977, J. Non-Newtonian Fluid Mech. 2, 353",
    check="Measure uniaxial extension: the viscosity should level off; N2 should be zero.",
    visible="epsilon of about 0.03 at a Weissenberg number of 1.",
)
