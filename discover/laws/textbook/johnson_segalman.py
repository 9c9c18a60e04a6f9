"""Johnson–Segalman law."""

import equinox as eqx
from jaxtyping import Array, Float

from discover.laws.base import AbstractConstitutiveLaw, NamedLaw, as_parameter
from tensor_library.algebra import Symmetric, anticommutator
from tensor_library.isotropic_function import IsotropicFunction, scalars
from tensor_library.law_terms import LawTerm


class JohnsonSegalman(AbstractConstitutiveLaw):
    """Johnson–Segalman law: h = (ξ/2)(σ·γ̇ + γ̇·σ)   [Johnson & Segalman 1977, JNNFM 2, 255]."""

    slip_parameter: Float[Array, ""] = eqx.field(converter=as_parameter)  # ξ, 0 to 2
    linear_relaxation: bool = eqx.field(static=True, default=True)

    def extra_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        """Return h = (ξ/2)(σ·γ̇ + γ̇·σ)."""
        return 0.5 * self.slip_parameter * anticommutator(stress, rate)

    def as_terms(self) -> tuple[LawTerm, ...]:
        """Return h as a sum of library terms."""
        return (LawTerm("sigma.gammadot+gammadot.sigma", 0.5 * float(self.slip_parameter)),)


NAMED = {
    "johnson_segalman": NamedLaw(
        "Johnson–Segalman",
        JohnsonSegalman,
        {"xi": (0.0, 2.0)},
        {"xi": "Johnson & Segalman 1977: from the upper (0) to the lower (2) convected derivative"},
        source="Johnson & Segalman 1977, J. Non-Newtonian Fluid Mech. 2, 255",
        written=lambda: IsotropicFunction({"sigma.gammadot+gammadot.sigma": scalars("xi") / 2}),
        contains={"ucm": {"xi": 0.0}},
    )
}
