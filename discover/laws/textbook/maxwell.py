"""Upper convected Maxwell law."""

import equinox as eqx
import jax.numpy as jnp

from discover.laws.base import AbstractConstitutiveLaw, NamedLaw
from tensor_library.algebra import Symmetric
from tensor_library.isotropic_function import IsotropicFunction
from tensor_library.law_terms import LawTerm


class UpperConvectedMaxwell(AbstractConstitutiveLaw):
    """Upper convected Maxwell law: h = 0   [Oldroyd 1950, Proc. R. Soc. A 200, 523]."""

    linear_relaxation: bool = eqx.field(static=True, default=True)

    def extra_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        """Return h = 0."""
        del rate
        return jnp.zeros_like(stress)

    def as_terms(self) -> tuple[LawTerm, ...]:
        """Return h as a sum of library terms."""
        return ()


NAMED = {
    "ucm": NamedLaw(
        "upper convected Maxwell",
        UpperConvectedMaxwell,
        {},
        source="Oldroyd 1950, Proc. R. Soc. London A 200, 523",
        written=lambda: IsotropicFunction({}),
    )
}
