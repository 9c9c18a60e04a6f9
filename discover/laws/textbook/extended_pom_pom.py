"""Extended pom-pom law of branched melts."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from discover.laws.base import AbstractConstitutiveLaw, NamedLaw, as_parameter
from discover.laws.textbook.rolie_poly import stretch_of
from tensor_library.algebra import Symmetric, identity_like, inner, square
from tensor_library.isotropic_function import IsotropicFunction, scalars


class ExtendedPomPom(AbstractConstitutiveLaw):
    """XPP law in its single-equation form   [Verbeeten, Peters & Baaijens 2001, J. Rheol. 45, 823].

    With the stretch of the backbone Λ = √(1 + tr σ/3),

        h = α σ·σ + (f − 1)(σ + I),
        f = 2 (λ/λ_s) e^{2(Λ − 1)/q} (1 − 1/Λ) + (1 − α tr(σ·σ)/3)/Λ²:

    λ is the time in which the backbone turns, λ_s that in which it retracts, and q the number of
    arms at each of its ends, which hold it the less the further it is drawn.
    """

    arms: Float[Array, ""] = eqx.field(converter=as_parameter)  # q
    stretch_time_ratio: Float[Array, ""] = eqx.field(converter=as_parameter)  # λ_s/λ
    anisotropy: Float[Array, ""] = eqx.field(converter=as_parameter)  # α
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


def _written() -> IsotropicFunction:
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


NAMED = {
    "xpp": NamedLaw(
        "extended pom-pom",
        ExtendedPomPom,
        {"q": (1.0, 100.0), "stretch_time_ratio": (0.01, 1.0), "alpha": (0.0, 1.0)},
        {
            "q": "McLeish & Larson 1998: whole arms of one molecule, from the end of a linear "
            "chain on; fits of polyethylene give up to some thirty",
            "stretch_time_ratio": "Inkson et al. 1999, J. Rheol. 43, 873: a backbone retracts "
            "before it turns; fits of polyethylene give 1/10 to 1",
            "alpha": "Giesekus 1982: a mobility that no stress can make negative; Verbeeten, "
            "Peters & Baaijens 2001 have up to 0.3",
        },
        source="Verbeeten, Peters & Baaijens 2001, J. Rheol. 45, 823",
        written=_written,
    )
}
