"""Pom-pom laws of branched melts: the extended one, and those whose backbone ends."""

from functools import partial
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from discover.laws import base
from discover.laws.textbook.rolie_poly import stretch_of
from tensor_library.algebra import Symmetric, identity_like, inner, square, trace
from tensor_library.isotropic_function import IsotropicFunction, scalars


class ExtendedPomPom(base.AbstractConstitutiveLaw):
    """XPP law in its single-equation form   [Verbeeten, Peters & Baaijens 2001, J. Rheol. 45, 823].

    With Λ = √(1 + tr σ/3) and q arms at each end of the backbone,

        h = α σ·σ + (f − 1)(σ + I),
        f = 2 (λ/λ_s) e^{2(Λ − 1)/q} (1 − 1/Λ) + (1 − α tr(σ·σ)/3)/Λ².
    """

    arms: Float[Array, ""] = eqx.field(converter=base.as_parameter)  # q
    stretch_time_ratio: Float[Array, ""] = eqx.field(converter=base.as_parameter)  # λ_s/λ
    anisotropy: Float[Array, ""] = eqx.field(converter=base.as_parameter)  # α
    linear_relaxation: bool = eqx.field(static=True, default=True)

    retracts: ClassVar[bool] = True

    def extra_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        del rate
        stretch = stretch_of(stress)
        withdrawn = jnp.exp(2.0 / self.arms * (stretch - 1.0))
        retraction = 2.0 / self.stretch_time_ratio * withdrawn * (1.0 - 1.0 / stretch)
        turning = (1.0 - self.anisotropy * inner(stress, stress) / 3.0) / stretch**2
        excess = retraction + turning - 1.0
        return self.anisotropy * square(stress) + excess * (stress + identity_like(stress))


def _written_extended() -> IsotropicFunction:
    import sympy

    arms, ratio, alpha = scalars("q", "stretch_time_ratio", "alpha")
    stretch, f, squared = scalars("Lambda", "f", "tr(sigma.sigma)")
    retraction = 2 / ratio * sympy.exp(2 * (stretch - 1) / arms) * (1 - 1 / stretch)
    where = {
        "Lambda": sympy.sqrt(1 + scalars("tr(sigma)") / 3),
        "f": retraction + (1 - alpha * squared / 3) / stretch**2,
    }
    coefficients = {"sigma.sigma": alpha, "sigma": f - 1, "I": f - 1}
    return IsotropicFunction(coefficients, where, {"stretch_time_ratio": r"\theta"})


_FADES = 0.05
"""Share of q over which growth fades on the way to it, so that steps of fixed length can follow."""

_ONE_ARM = 1e-3
"""The least of q − 1 in a division."""


class PomPom(base.AbstractConstitutiveLaw):
    """Differential pom-pom law   [McLeish & Larson 1998, J. Rheol. 42, 81].

    A backbone of orientation S = A/tr A and stretch Λ ≤ q, with q arms at each end:

        A▽ = −(A − I),    dΛ/dt = Λ L:S − (λ/λ_s) e^{ν(Λ−1)} (Λ − 1),    σ = 3 Λ² S − I.

    ν = 0, or 2/(q − 1) where the drag of the arms couples to the strain at the branch points
    [Blackwell, McLeish & Harlen 2000, J. Rheol. 44, 121, as RepTate has it]. Written for σ, with Λ²
    = 1 + tr σ/3 and the structure variable y = ln(tr A/3),

        h = e^{−y} (σ − tr σ/3 I) − σ + r (σ + I),    r = 2 (λ/λ_s) e^{ν(Λ−1)} (1 − 1/Λ),
        dy/dt = S:γ̇ − 1 + e^{−y}.

    At Λ = q arms are drawn in; the growth of the stretch fades over the last 5 %.
    """

    arms: Float[Array, ""] = eqx.field(converter=base.as_parameter)  # q
    stretch_time_ratio: Float[Array, ""] = eqx.field(converter=base.as_parameter)  # λ_s/λ
    drag_strain: bool = eqx.field(static=True, default=False)
    linear_relaxation: bool = eqx.field(static=True, default=True)

    variables: ClassVar[int] = 1
    retracts: ClassVar[bool] = True

    def extra_term(self, stress: base.State, rate: Symmetric) -> base.State:
        """Return h(σ, y, γ̇) as above, and of y what its change is short of −y."""
        sigma, y = base.stress_in(stress), stress[4]
        one = identity_like(sigma)
        stretch = stretch_of(sigma)
        growth = inner(sigma + one, rate) / (3.0 * stretch**2)  # S:γ̇
        retraction = 2.0 / self.stretch_time_ratio * (1.0 - 1.0 / stretch)
        if self.drag_strain:
            # far beyond q only in trial steps of an integrator; with one arm nothing is drawn
            drawn = (stretch - 1.0) / jnp.maximum(self.arms - 1.0, _ONE_ARM)
            retraction *= jnp.exp(jnp.minimum(2.0 * drawn, 50.0))
        left = (self.arms - stretch) / (_FADES * self.arms)
        halted = (1.0 - jnp.clip(left, 0.0, 1.0)) * jnp.maximum(growth - retraction, 0.0)
        # beyond q, where a long step may end, chains shrink: else all Λ there would be steady
        halted += jnp.clip(-left, 0.0, 1.0) * retraction
        turning = jnp.exp(-jnp.maximum(y, -50.0))
        deviator = sigma - trace(sigma) / 3.0 * one
        extra = turning * deviator - sigma + (retraction + halted) * (sigma + one)
        return base.as_state(extra, stress).at[4].set(1.0 - turning - y - growth)


def _written(drag_strain: bool = False) -> IsotropicFunction:
    import sympy

    def between_0_and_1(share):
        return sympy.Max(0, share) - sympy.Max(0, share - 1)

    arms, ratio, y, trace = scalars("q", "stretch_time_ratio", "y", "tr(sigma)")
    stretch, g, r, left, b = scalars("Lambda", "g", "r", "p", "b")
    held = sympy.exp(2 * (stretch - 1) / sympy.Max(_ONE_ARM, arms - 1)) if drag_strain else 1
    where = {
        "Lambda": sympy.sqrt(1 + trace / 3),
        "g": scalars("tr(sigma.gammadot)") / (3 * stretch**2),
        "r": 2 / ratio * held * (1 - 1 / stretch),
        "p": (arms - stretch) / (_FADES * arms),
        "b": r * (1 + between_0_and_1(-left)) + between_0_and_1(1 - left) * sympy.Max(g - r, 0),
    }
    turning = sympy.exp(-y)
    coefficients = {"sigma": turning - 1 + b, "I": b - turning * trace / 3}
    letters = {"stretch_time_ratio": r"\theta"}
    return IsotropicFunction(coefficients, where, letters, {"y": g - 1 + turning})


_RANGES = {"q": (1.0, 100.0), "stretch_time_ratio": (0.01, 1.0)}
_RANGE_SOURCES = {
    "q": "McLeish & Larson 1998: whole arms of one molecule, from the end of a linear "
    "chain on; fits of polyethylene give up to some thirty",
    "stretch_time_ratio": "Inkson et al. 1999, J. Rheol. 43, 873: a backbone retracts "
    "before it turns; fits of polyethylene give 1/10 to 1",
}

NAMED = {
    "xpp": base.NamedLaw(
        "extended pom-pom",
        ExtendedPomPom,
        {**_RANGES, "alpha": (0.0, 1.0)},
        {
            **_RANGE_SOURCES,
            "alpha": "Giesekus 1982: a mobility that no stress can make negative; Verbeeten, "
            "Peters & Baaijens 2001 have up to 0.3",
        },
        source="Verbeeten, Peters & Baaijens 2001, J. Rheol. 45, 823",
        written=_written_extended,
    ),
    "pom_pom": base.NamedLaw(
        "pom-pom",
        PomPom,
        _RANGES,
        _RANGE_SOURCES,
        source="McLeish & Larson 1998, J. Rheol. 42, 81",
        written=_written,
    ),
    "pom_pom_drag_strain": base.NamedLaw(
        "pom-pom with drag-strain coupling",
        partial(PomPom, drag_strain=True),
        _RANGES,
        _RANGE_SOURCES,
        source="Blackwell, McLeish & Harlen 2000, J. Rheol. 44, 121",
        written=partial(_written, drag_strain=True),
    ),
}
