"""Maxwell laws whose relaxation a scalar scales: Saramito (yield), White–Metzner (rate)."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from discover.laws.base import AbstractConstitutiveLaw, NamedLaw, as_parameter
from tensor_library.algebra import Symmetric, identity_like, inner, trace
from tensor_library.isotropic_function import IsotropicFunction, scalars


class Saramito(AbstractConstitutiveLaw):
    """Elastoviscoplastic law   [Saramito 2007, JNNFM 145, 1].

    h = −min(1, Y/|σ_d|) σ with the deviator σ_d, |σ_d|² = ½ σ_d:σ_d, and the yield stress over the
    modulus Y: below it nothing relaxes, far beyond it the fluid is Maxwell's.
    """

    yield_strain: Float[Array, ""] = eqx.field(converter=as_parameter)  # Y
    linear_relaxation: bool = eqx.field(static=True, default=True)

    def extra_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        del rate
        deviator = stress - trace(stress) / 3.0 * identity_like(stress)
        squared = 0.5 * inner(deviator, deviator)
        yielded = squared > self.yield_strain**2
        # so that the derivative is finite where nothing flows
        size = jnp.sqrt(jnp.where(yielded, squared, 1.0))
        return -jnp.where(yielded, self.yield_strain / size, 1.0) * stress


def _written_saramito() -> IsotropicFunction:
    import sympy

    yielding, size = scalars("yield_strain", "size")
    squared = scalars("tr(sigma.sigma)") / 2 - scalars("tr(sigma)") ** 2 / 6
    # bounded, so that the derivative is finite where nothing flows
    where = {"size": sympy.sqrt(sympy.Max(squared, 1e-24))}
    letters = {"yield_strain": "Y", "size": r"\left|\sigma_\mathrm{d}\right|"}
    return IsotropicFunction({"sigma": -yielding / sympy.Max(yielding, size)}, where, letters)


class WhiteMetzner(AbstractConstitutiveLaw):
    """White–Metzner law: h = [(1 + (kγ̇)²)^{(1−n)/2} − 1] σ   [J. Appl. Polym. Sci. 7, 1867, 1963].

    The relaxation time is Carreau's function of the rate, |γ̇|² = ½ γ̇:γ̇, and the modulus constant.
    """

    onset: Float[Array, ""] = eqx.field(converter=as_parameter)  # k, over λ
    exponent: Float[Array, ""] = eqx.field(converter=as_parameter)  # n
    linear_relaxation: bool = eqx.field(static=True, default=True)

    def extra_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        squared = self.onset**2 * 0.5 * inner(rate, rate)
        return ((1.0 + squared) ** (0.5 * (1.0 - self.exponent)) - 1.0) * stress


def _written_white_metzner() -> IsotropicFunction:
    k, n, squared = scalars("k", "n", "tr(gammadot.gammadot)")
    return IsotropicFunction({"sigma": (1 + k**2 * squared / 2) ** ((1 - n) / 2) - 1})


NAMED = {
    "saramito": NamedLaw(
        "Saramito",
        Saramito,
        {"yield_strain": (0.0, 10.0)},
        {
            "yield_strain": "Saramito 2007: the strain at which the solid yields; gels and foams "
            "yield at a tenth to a few"
        },
        source="Saramito 2007, J. Non-Newtonian Fluid Mech. 145, 1",
        written=_written_saramito,
    ),
    "white_metzner": NamedLaw(
        "White–Metzner",
        WhiteMetzner,
        {"k": (0.0, 100.0), "n": (0.0, 1.0)},
        {
            "k": "a law whose thinning begins at a hundredth of the rate 1/λ has another λ",
            "n": "Bird, Armstrong & Hassager 1987, ch. 4: from a stress that rises with rate as a "
            "Newtonian fluid's (1) to one that does not rise (0)",
        },
        source="White & Metzner 1963, J. Appl. Polym. Sci. 7, 1867",
        written=_written_white_metzner,
    ),
}
