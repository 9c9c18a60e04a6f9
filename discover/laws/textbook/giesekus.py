"""Giesekus law."""

import equinox as eqx
from jaxtyping import Array, Float

from discover.laws.base import AbstractConstitutiveLaw, NamedLaw, as_parameter
from tensor_library.algebra import Symmetric, square
from tensor_library.isotropic_function import IsotropicFunction, scalars
from tensor_library.law_terms import LawTerm


class Giesekus(AbstractConstitutiveLaw):
    """Giesekus law: h = α σ·σ   [Giesekus 1982, JNNFM 11, 69]."""

    mobility: Float[Array, ""] = eqx.field(converter=as_parameter)  # α, 0 to 1
    linear_relaxation: bool = eqx.field(static=True, default=True)

    def extra_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        """Return h = α σ·σ."""
        del rate  # this law has no explicit rate dependence
        return self.mobility * square(stress)

    def as_terms(self) -> tuple[LawTerm, ...]:
        """Return h as a sum of library terms."""
        return (LawTerm("sigma.sigma", float(self.mobility)),)


NAMED = {
    "giesekus": NamedLaw(
        "Giesekus",
        Giesekus,
        {"alpha": (0.0, 1.0)},
        {"alpha": "Giesekus 1982: a mobility that no stress can make negative"},
        source="Giesekus 1982, J. Non-Newtonian Fluid Mech. 11, 69",
        written=lambda: IsotropicFunction({"sigma.sigma": scalars("alpha")}),
        contains={"ucm": {"alpha": 0.0}},
    )
}
