"""FENE-P law in stress form."""

import equinox as eqx
from jaxtyping import Array, Float

from discover.laws.base import AbstractConstitutiveLaw, NamedLaw, as_parameter
from tensor_library.algebra import Symmetric, identity_like, inner, trace
from tensor_library.isotropic_function import IsotropicFunction, scalars
from tensor_library.law_terms import LawTerm


class FenePeterlin(AbstractConstitutiveLaw):
    """FENE-P law   [Bird, Dotson & Johnson 1980, JNNFM 7, 213].

    With the conformation A at equilibrium I, σ = f A − I and f = (L² − 3)/(L² − tr A). Eliminating
    A gives f = 1 + tr(σ)/L² and, with the upper convected derivative of A equal to −σ,

        h = (f − 1) σ − (ḟ/f)(σ + I),    ḟ = (tr(σ·γ̇) − f tr σ)/(L² − tr A),

    so that the law is one of Maxwell type whose extra term depends on the rate. L² → ∞ is UCM.
    """

    maximum_extension_squared: Float[Array, ""] = eqx.field(converter=as_parameter)  # L², over 3
    linear_relaxation: bool = eqx.field(static=True, default=True)

    def extra_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        """Return h(σ, γ̇) as above."""
        limit = self.maximum_extension_squared
        trace_of_stress = trace(stress)
        factor = 1.0 + trace_of_stress / limit
        trace_of_conformation = (trace_of_stress + 3.0) / factor
        factor_rate = (inner(stress, rate) - factor * trace_of_stress) / (
            limit - trace_of_conformation
        )
        return (factor - 1.0) * stress - factor_rate / factor * (stress + identity_like(stress))

    def as_terms(self) -> tuple[LawTerm, ...]:
        """Return h as a sum of library terms."""
        return fene_p_terms(1.0 / float(self.maximum_extension_squared))


def fene_p_terms(inverse: float) -> tuple[LawTerm, ...]:
    """Return the extra term of FENE-P, with q = 1/L², multiplied out."""
    growth = inverse / (1.0 - 3.0 * inverse)
    return (
        LawTerm("tr(sigma)*sigma", inverse + growth),
        LawTerm("tr(sigma)^2*sigma", growth * inverse),
        LawTerm("tr(sigma.gammadot)*sigma", -growth),
        LawTerm("tr(sigma)*I", growth),
        LawTerm("tr(sigma)^2*I", growth * inverse),
        LawTerm("tr(sigma.gammadot)*I", -growth),
    )


def _written() -> IsotropicFunction:
    limit, trace, power, f, w = scalars("L2", "tr(sigma)", "tr(sigma.gammadot)", "f", "w")
    # with L² − tr A = (L² − 3)/f
    where = {"f": 1 + trace / limit, "w": (power - f * trace) / (limit - 3)}
    return IsotropicFunction({"sigma": f - 1 - w, "I": -w}, where, {"L2": "L^{2}"})


NAMED = {
    "fene_p": NamedLaw(
        "FENE-P",
        FenePeterlin,
        {"L2": (3.0 + 1e-6, 1e6)},
        {
            "L2": "Bird, Dotson & Johnson 1980: a chain at rest has L² = 3 already; at a million, "
            "longer than of any polymer, the springs are Hooke's"
        },
        source="Bird, Dotson & Johnson 1980, J. Non-Newtonian Fluid Mech. 7, 213",
        written=_written,
        contains={"ucm": {"L2": 1e6}},
    )
}
