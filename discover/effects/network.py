"""Effects of the fluid: terms of the law of every mode, added modes and stresses."""

from collections.abc import Callable
from dataclasses import dataclass, field

import jax.numpy as jnp

from discover.effects.base import ConstitutiveEffect, EffectParameter, ModeEffect
from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.textbook import classical
from tensor_library import LawTerm, identity_like, inner


class ConvectiveConstraintRelease(ConstitutiveEffect):
    """Adds c tr(σ·γ̇)[(1 + β)σ + I] [Likhtman & Graham 2003; β = 0: Larson 1984, J. Rheol. 28]."""

    def extra_term(self, values, stress, rate):
        release = (1.0 + values[1]) * stress + identity_like(stress)
        return values[0] * inner(stress, rate) * release

    def as_terms(self, values):
        c, beta = values
        return (
            LawTerm("tr(sigma.gammadot)*sigma", c * (1.0 + beta)),
            LawTerm("tr(sigma.gammadot)*I", c),
        )


CONVECTIVE_CONSTRAINT_RELEASE = ConvectiveConstraintRelease(
    name="convective_constraint_release", complexity=3, explicit_rate=True,
    parameters=(
        EffectParameter(
            "c", "c", low=0.0, high=1.0, first_trial=0.01,
            range_source="1/3 is the law of Likhtman & Graham without stretch, in which the flow "
            "does not change the length of the chains; at three times that it would have to",
        ),
        EffectParameter(
            "beta", r"\beta", low=0.0, high=1.0, first_trial=0.5,
            absent="partly_retracting_strands",
            range_source="Likhtman & Graham 2003: the share of released constraints that counts, "
            "from none to all",
        ),
    ),
    equation=r"h \mathrel{+}= c\,\mathrm{tr}(\sigma\cdot\dot\gamma)\left[(1+\beta)\,\sigma + "
    r"I\right]",
    source="Likhtman & Graham 2003, J. Non-Newtonian Fluid Mech. 114, 1",
    check="Measure steady shear at high rates: the stress should not fall with the rate.",
    visible="c of about 0.02 at a Weissenberg number of 1.",
)  # fmt: skip


class FiniteExtensibility(ConstitutiveEffect):
    """Turns Maxwell into FENE-P with q = 1/L²   [Bird, Dotson & Johnson 1980, JNNFM 7, 213]."""

    def extra_term(self, values, stress, rate):
        return classical.fene_p(values[0], 1.0 - 3.0 * values[0], stress, rate)

    def as_terms(self, values):
        return classical.fene_p_terms(values[0])


FINITE_EXTENSIBILITY = FiniteExtensibility(
    name="finite_extensibility", complexity=2,
    parameters=(
        EffectParameter(
            "q", "q", low=0.0, high=0.3, first_trial=0.005,
            range_source="Bird, Dotson & Johnson 1980: a chain at rest has L² = 3 already, so "
            "that q is below 1/3",
        ),
    ),
    equation=r"h \mathrel{+}= q\,\mathrm{tr}(\sigma)\,\sigma - \frac{q}{1 - "
    r"3q}\left[\mathrm{tr}(\sigma\cdot\dot\gamma) - (1 + "
    r"q\,\mathrm{tr}\,\sigma)\,\mathrm{tr}\,\sigma\right](\sigma + I),\quad q = 1/L^2",
    source="Bird, Dotson & Johnson 1980, J. Non-Newtonian Fluid Mech. 7, 213 (FENE-P)",
    check="Measure uniaxial extension: the viscosity should level off; N2 should be zero.",
    visible="q of about 0.02 at a Weissenberg number of 1, less in faster flow.",
)  # fmt: skip


@dataclass(frozen=True)
class AddedLaw(ConstitutiveEffect):
    """Adds the h of a law, with the effect's parameters for its constants."""

    law: Callable[..., AbstractConstitutiveLaw] = field(kw_only=True)

    def extra_term(self, values, stress, rate):
        return self.law(*values).extra_term(stress, rate)

    def as_terms(self, values):
        """Return h of the law as a sum of library terms; None of a law that is none."""
        return self.law(*values).as_terms()


GIESEKUS_MOBILITY = AddedLaw(
    name="giesekus_mobility", law=classical.Giesekus,
    parameters=(
        EffectParameter(
            "alpha", r"\alpha", meaning="mobility", low=0.0, high=1.0, first_trial=0.01,
            range_source=classical.NAMED["giesekus"].range_sources["alpha"],
        ),
    ),
    equation=r"h \mathrel{+}= \alpha\,\sigma\cdot\sigma",
    source="Giesekus 1982, J. Non-Newtonian Fluid Mech. 11, 69",
    check="Measure N2 at low rates: N2/N1 should be near −α/2.",
    visible="alpha of about 0.05 at a Weissenberg number of 1.",
)  # fmt: skip


NON_AFFINE_MOTION = AddedLaw(
    name="non_affine_motion", law=classical.JohnsonSegalman, explicit_rate=True,
    parameters=(
        EffectParameter(
            "xi", r"\xi", meaning="slip of the network", low=0.0, high=1.0, first_trial=0.01,
            range_source="Johnson & Segalman 1977: from the upper (0) to the lower (2) convected "
            "derivative; shear stress and N1 depend on ξ(2 − ξ) alone and cannot tell ξ from 2 − "
            "ξ; the smaller one is named, since measured −N2/N1 = ξ/2 is small",
        ),
    ),
    equation=r"h \mathrel{+}= \tfrac{\xi}{2}(\sigma\cdot\dot\gamma + \dot\gamma\cdot\sigma)",
    source="Johnson & Segalman 1977, J. Non-Newtonian Fluid Mech. 2, 255",
    check="Measure a fast start-up: the stress should oscillate; N2/N1 should be near −ξ/2.",
    visible="xi of about 0.05 at a Weissenberg number of 1.",
)  # fmt: skip


_ELONGATION = EffectParameter(
    "epsilon", r"\varepsilon", meaning="elongational parameter", low=0.0, high=10.0,
    first_trial=0.01,
    range_source=classical.NAMED["ptt_linear"].range_sources["epsilon"],
)  # fmt: skip


PTT_EXPONENTIAL = AddedLaw(
    name="ptt_exponential", law=classical.ExponentialPhanThienTanner, complexity=2,
    parameters=(_ELONGATION,),
    equation=r"h \mathrel{+}= (e^{\varepsilon\,\mathrm{tr}\,\sigma} - 1)\,\sigma",
    source="Phan-Thien 1978, J. Rheol. 22, 259",
    check="Measure uniaxial extension: the viscosity should pass a maximum; N2 should be zero.",
    visible="epsilon of about 0.03 at a Weissenberg number of 1.",
)  # fmt: skip


PTT_LINEAR = AddedLaw(
    name="ptt_linear", law=classical.LinearPhanThienTanner,
    parameters=(_ELONGATION,),
    equation=r"h \mathrel{+}= \varepsilon\,\mathrm{tr}(\sigma)\,\sigma",
    source="Phan-Thien & Tanner 1977, J. Non-Newtonian Fluid Mech. 2, 353",
    check="Measure uniaxial extension: the viscosity should level off; N2 should be zero.",
    visible="epsilon of about 0.03 at a Weissenberg number of 1.",
)  # fmt: skip


_AT_REST = 1e-300
"""Below any |γ̇|² that matters: the root has no derivative at zero."""


class StrainDamping(ConstitutiveEffect):
    """Adds n λ|γ̇| (σ + I), |γ̇|² = ½ γ̇:γ̇: strands lost for good [Wagner & Stephenson 1979].

    Where the flow does not turn, K-BKZ with Wagner's damping function e^{−nγ} [Wagner 1976].
    """

    # Finger's and Cauchy's tensor in any proportion have one σ12 and N1   [Wagner & Demarmels 1990]
    leaves_second_difference_open = True

    def extra_term(self, values, stress, rate):
        size = jnp.sqrt(jnp.maximum(0.5 * inner(rate, rate), _AT_REST))
        return values[0] * size * (stress + identity_like(stress))


STRAIN_DAMPING = StrainDamping(
    name="strain_damping", explicit_rate=True,
    parameters=(
        EffectParameter(
            "n", "n", low=0.0, high=10.0, first_trial=0.02,
            range_source="a strain of 1/n takes the strands, and networks of chains are linear up "
            "to 10 % (Treloar 1975, The Physics of Rubber Elasticity, ch. 5); melts have 0.1 to "
            "0.4 (Wagner 1976)",
        ),
    ),
    equation=r"h \mathrel{+}= n\,\lambda|\dot\gamma|\,(\sigma + I)",
    source="Wagner 1976, Rheol. Acta 15, 136; Wagner & Stephenson 1979, J. Rheol. 23, 489",
    check="Step the strain: the relaxation curves should differ by a factor e^{−nγ} alone.",
    visible="n times the strain within a relaxation time of about 0.05.",
)  # fmt: skip


# only the stress beyond yield relaxes, with the factor max(0, 1 − Y/|σ_d|)
YIELD_STRESS = AddedLaw(
    name="yield_stress", law=classical.Saramito, complexity=2,
    parameters=(
        EffectParameter(
            "yield_strain", "Y", low=0.0, high=10.0, first_trial=0.01,
            range_source="Bonn et al. 2017, Rev. Mod. Phys. 89, 035005: soft solids yield at "
            "strains of 0.001 to 1, elastic gels at a few",
        ),
    ),
    equation=r"h \mathrel{-}= \min\left(1, \frac{Y}{|\sigma_d|}\right)\sigma,\quad "
    r"\sigma_\mathrm{y} = Y\,G",
    source="Saramito 2007, J. Non-Newtonian Fluid Mech. 145, 1",
    check="Creep below and above Y times the modulus: only above it should flow go on.",
    visible="Y of about 5 % of the dimensionless stress.",
)  # fmt: skip


class RelaxationMode(ModeEffect):
    """One more mode under the declared law   [generalised Maxwell model, Ferry 1980, ch. 1]."""

    def mode(self, values):
        return values[0], values[1]


RELAXATION_MODE = RelaxationMode(
    name="relaxation_mode", complexity=2,
    parameters=(
        EffectParameter(
            "G", "G_+", "Pa", meaning="modulus of the added mode, listed below", low=0.0,
            high=1e10, scale="stress", first_trial=0.05,
            range_source="Ferry 1980, ch. 2: glasses have 1e9 Pa, and nothing that flows has more",
        ),
        EffectParameter(
            "lambda", r"\lambda_+", "s", meaning="time of the added mode, listed below", low=1e-6,
            high=30.0, scale="run_time", first_trial=0.1, range_scale="run_time",
            range_source="a mode that is a millionth of a run long cannot be told from a solvent, "
            "nor one that is 30 runs long from a spring (Davies & Anderssen 1997, J. "
            "Non-Newtonian Fluid Mech. 73, 163: records determine times little beyond their own "
            "window)",
        ),
    ),
    equation=r"\sigma \mathrel{+}= G_+\,\sigma_+,\quad \lambda_+\overset{\nabla}{\sigma}_+ + "
    r"\sigma_+ + h(\sigma_+) = \lambda_+\dot\gamma",
    source="Ferry 1980, Viscoelastic Properties of Polymers, ch. 1",
    check="Measure small-amplitude oscillation around the angular frequency 1/λ.",
    visible="G lambda of about 5 % of the zero-shear viscosity.",
)  # fmt: skip


class SolventViscosity(ConstitutiveEffect):
    """Adds η_s γ̇ to the stress   [Oldroyd 1950, Proc. R. Soc. A 200, 523]."""

    def instantaneous_stress(self, values, shear_rate):
        return values[0] * shear_rate


SOLVENT_VISCOSITY = SolventViscosity(
    name="solvent_viscosity",
    parameters=(
        EffectParameter(
            "eta_s", r"\eta_s", "Pa s", low=0.0, high=10.0, scale="viscosity", first_trial=0.01,
            range_scale="viscosity",
            range_source="a part of the stress cannot exceed the whole in the fastest flow; ten "
            "times leaves room for runs that differ",
        ),
    ),
    equation=r"\sigma \mathrel{+}= \eta_s\,\dot\gamma",
    source="Oldroyd 1950, Proc. R. Soc. A 200, 523",
    check="Step the rate: the stress should jump at once; G'' should end linear in frequency.",
    visible="eta_s of about 5 % of the zero-shear viscosity; less where the rate changes fast.",
)  # fmt: skip
