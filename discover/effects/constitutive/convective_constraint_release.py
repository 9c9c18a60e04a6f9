"""Release of entanglements by the flow."""

from discover.effects.base import ConstitutiveEffect, EffectParameter
from tensor_library.algebra import identity_like, inner
from tensor_library.law_terms import LawTerm


class ConvectiveConstraintRelease(ConstitutiveEffect):
    """Adds c tr(σ·γ̇)[(1 + β)σ + I]   [Likhtman & Graham 2003, JNNFM 114, 1].

    With c = 1/3 it is the Rolie–Poly law without stretch. With β = 0 nothing is released, and it
    is the law of strands that retract partly, of rigid rods where c = 1/3   [Larson 1984, J. Rheol.
    28, 545].
    """

    def extra_term(self, values, stress, rate):
        """Return c tr(σ·γ̇)[(1 + β)σ + I]."""
        release = (1.0 + values[1]) * stress + identity_like(stress)
        return values[0] * inner(stress, rate) * release

    def as_terms(self, values):
        """Return both parts."""
        c, beta = values
        return (
            LawTerm("tr(sigma.gammadot)*sigma", c * (1.0 + beta)),
            LawTerm("tr(sigma.gammadot)*I", c),
        )


EFFECT = ConvectiveConstraintRelease(
    name="convective_constraint_release",
    parameters=(
        EffectParameter(
            "c",
            "c",
            low=0.0,
            high=1.0,
            first_trial=0.01,
            range_source="1/3 is the law of Likhtman & Graham without stretch, in which the flow "
            "does not change the length of the chains; at three times that it would have to",
        ),
        EffectParameter(
            "beta",
            r"\beta",
            low=0.0,
            high=1.0,
            first_trial=0.5,
            range_source="Likhtman & Graham 2003: the share of released constraints that counts, "
            "from none to all",
            ends=("low", "high"),
            absent="partly_retracting_strands",
        ),
    ),
    equation=(
        r"h \mathrel{+}= c\,\mathrm{tr}(\sigma\cdot\dot\gamma)"
        r"\left[(1+\beta)\,\sigma + I\right]"
    ),
    source="Likhtman & Graham 2003, J. Non-Newtonian Fluid Mech. 114, 1",
    check="Measure steady shear at high rates: the stress should not fall with the rate.",
    visible="c of about 0.02 at a Weissenberg number of 1.",
    complexity=3,
    explicit_rate=True,
)
