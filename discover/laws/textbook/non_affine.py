"""Giesekus and PTT laws whose chains slip, as Johnson & Segalman's do."""

from collections.abc import Callable

import equinox as eqx
from jaxtyping import Array, Float

from discover.laws.base import AbstractConstitutiveLaw, NamedLaw, as_parameter
from discover.laws.textbook.classical import NAMED as CLASSICAL
from tensor_library.algebra import Symmetric, anticommutator
from tensor_library.isotropic_function import IsotropicFunction
from tensor_library.law_terms import LawTerm


class NonAffine(AbstractConstitutiveLaw):
    """A law with (ξ/2)(σ·γ̇ + γ̇·σ) added to its h   [Johnson & Segalman 1977, JNNFM 2, 255]."""

    affine: AbstractConstitutiveLaw
    slip_parameter: Float[Array, ""] = eqx.field(converter=as_parameter)  # ξ, 0 to 2
    linear_relaxation: bool = eqx.field(static=True, default=True)

    def extra_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        slip = 0.5 * self.slip_parameter * anticommutator(stress, rate)
        return self.affine.extra_term(stress, rate) + slip

    def as_terms(self) -> tuple[LawTerm, ...] | None:
        slip = LawTerm("sigma.gammadot+gammadot.sigma", 0.5 * float(self.slip_parameter))
        affine = self.affine.as_terms()
        return None if affine is None else (*affine, slip)


def _with_slip(name: str, named: NamedLaw) -> NamedLaw:
    slip = CLASSICAL["johnson_segalman"]

    def build(constant, xi) -> NonAffine:
        return NonAffine(affine=named.build(constant), slip_parameter=xi)

    def written() -> IsotropicFunction:
        assert named.written is not None
        assert slip.written is not None
        affine, slipping = named.written(), slip.written()
        return IsotropicFunction({**affine.coefficients, **slipping.coefficients}, affine.where)

    made: Callable[..., AbstractConstitutiveLaw] = build
    return NamedLaw(
        f"{named.title} with slip",
        made,
        {**named.parameters, **slip.parameters},
        {**named.range_sources, **slip.range_sources},
        source=f"{named.source}; {slip.source}",
        written=written,
    )


NAMED = {
    f"{name}_non_affine": _with_slip(name, law)
    for name, law in CLASSICAL.items()
    if name in ("giesekus", "ptt_linear", "ptt_exponential")
}
