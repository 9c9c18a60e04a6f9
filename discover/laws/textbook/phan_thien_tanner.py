"""Linear and exponential Phan-Thien–Tanner laws, affine (ξ = 0)."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from discover.laws.base import AbstractConstitutiveLaw, NamedLaw, as_parameter
from tensor_library.algebra import Symmetric, trace
from tensor_library.isotropic_function import IsotropicFunction, scalars
from tensor_library.law_terms import LawTerm


class LinearPhanThienTanner(AbstractConstitutiveLaw):
    """Linear PTT law: h = ε tr(σ) σ   [Phan-Thien & Tanner 1977, JNNFM 2, 353]."""

    extensibility: Float[Array, ""] = eqx.field(converter=as_parameter)  # ε
    linear_relaxation: bool = eqx.field(static=True, default=True)

    def extra_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        """Return h = ε tr(σ) σ."""
        del rate
        return self.extensibility * trace(stress) * stress

    def as_terms(self) -> tuple[LawTerm, ...]:
        """Return h as a sum of library terms."""
        return (LawTerm("tr(sigma)*sigma", float(self.extensibility)),)


class ExponentialPhanThienTanner(AbstractConstitutiveLaw):
    """Exponential PTT law: h = (exp(ε tr σ) − 1) σ   [Phan-Thien 1978, J. Rheol. 22, 259]."""

    extensibility: Float[Array, ""] = eqx.field(converter=as_parameter)  # ε
    linear_relaxation: bool = eqx.field(static=True, default=True)

    def extra_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        """Return h = (exp(ε tr σ) − 1) σ."""
        del rate
        return jnp.expm1(self.extensibility * trace(stress)) * stress

    def as_terms(self) -> tuple[LawTerm, ...]:
        """Return h as a sum of library terms."""
        inner = {"epsilon": float(self.extensibility)}
        return (LawTerm("(exp(epsilon*tr(sigma))-1)*sigma", 1.0, inner),)


def _written_linear() -> IsotropicFunction:
    return IsotropicFunction({"sigma": scalars("epsilon") * scalars("tr(sigma)")})


def _written_exponential() -> IsotropicFunction:
    import sympy

    return IsotropicFunction({"sigma": sympy.exp(scalars("epsilon") * scalars("tr(sigma)")) - 1})


_RANGE = {"epsilon": (0.0, 10.0)}
_RANGE_SOURCE = {
    "epsilon": "Phan-Thien & Tanner 1977: fast extension of linear PTT ends at 2 Gλ/ε, which ten "
    "puts to a fifteenth of Trouton's 3 Gλ; fluids have 0.01 to 1"
}

_CONTAINS = {"ucm": {"epsilon": 0.0}}

NAMED = {
    "ptt_linear": NamedLaw(
        "linear PTT",
        LinearPhanThienTanner,
        _RANGE,
        _RANGE_SOURCE,
        source="Phan-Thien & Tanner 1977, J. Non-Newtonian Fluid Mech. 2, 353",
        written=_written_linear,
        contains=_CONTAINS,
    ),
    "ptt_exponential": NamedLaw(
        "exponential PTT",
        ExponentialPhanThienTanner,
        _RANGE,
        _RANGE_SOURCE,
        source="Phan-Thien 1978, J. Rheol. 22, 259",
        written=_written_exponential,
        contains=_CONTAINS,
    ),
}
