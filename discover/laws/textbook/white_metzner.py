"""White–Metzner law: a Maxwell fluid whose relaxation quickens with the rate."""

import equinox as eqx
from jaxtyping import Array, Float

from discover.laws.base import AbstractConstitutiveLaw, NamedLaw, as_parameter
from tensor_library.algebra import Symmetric, inner
from tensor_library.isotropic_function import IsotropicFunction, scalars


class WhiteMetzner(AbstractConstitutiveLaw):
    """White–Metzner law: h = [(1 + (kγ̇)²)^{(1−n)/2} − 1] σ   [J. Appl. Polym. Sci. 7, 1867, 1963].

    The relaxation time is Carreau's function of the rate, |γ̇|² = ½ γ̇:γ̇, and the modulus constant.
    """

    onset: Float[Array, ""] = eqx.field(converter=as_parameter)  # k, over λ
    exponent: Float[Array, ""] = eqx.field(converter=as_parameter)  # n
    linear_relaxation: bool = eqx.field(static=True, default=True)

    def extra_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        """Return h(σ, γ̇) as above."""
        squared = self.onset**2 * 0.5 * inner(rate, rate)
        return ((1.0 + squared) ** (0.5 * (1.0 - self.exponent)) - 1.0) * stress


def _written() -> IsotropicFunction:
    k, n, squared = scalars("k", "n", "tr(gammadot.gammadot)")
    return IsotropicFunction({"sigma": (1 + k**2 * squared / 2) ** ((1 - n) / 2) - 1})


NAMED = {
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
        written=_written,
    )
}
