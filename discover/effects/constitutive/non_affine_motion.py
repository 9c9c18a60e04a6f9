"""Slip of the network against the flow."""

from discover.effects.base import ConstitutiveEffect, EffectParameter
from tensor_library.algebra import anticommutator
from tensor_library.law_terms import LawTerm


class NonAffineMotion(ConstitutiveEffect):
    """Adds (ξ/2)(σ·γ̇ + γ̇·σ)   [Johnson & Segalman 1977, JNNFM 2, 255]."""

    def extra_term(self, values, stress, rate):
        """Return (ξ/2)(σ·γ̇ + γ̇·σ)."""
        return 0.5 * values[0] * anticommutator(stress, rate)

    def as_terms(self, values):
        """Return (ξ/2)(σ·γ̇ + γ̇·σ)."""
        return (LawTerm("sigma.gammadot+gammadot.sigma", 0.5 * values[0]),)


EFFECT = NonAffineMotion(
    name="non_affine_motion",
    parameters=(
        EffectParameter(
            "xi",
            r"\xi",
            low=0.0,
            high=1.0,
            first_trial=0.01,
            range_source="Johnson & Segalman 1977: from the upper (0) to the lower (2) convected "
            "derivative; shear stress and N1 depend on ξ(2 − ξ) alone and cannot tell ξ from 2 − "
            "ξ; the smaller one is named, since measured −N2/N1 = ξ/2 is small",
        ),
    ),
    equation=r"h \mathrel{+}= \tfrac{\xi}{2}(\sigma\cdot\dot\gamma + \dot\gamma\cdot\sigma)",
    source="Johnson & Segalman 1977, J. Non-Newtonian Fluid Mech. 2, 255",
    check="Measure a fast start-up: the stress should oscillate; N2/N1 should be near −ξ/2.",
    visible="xi of about 0.05 at a Weissenberg number of 1.",
    explicit_rate=True,
)
