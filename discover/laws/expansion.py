"""A law as a sum of library terms: what sparse regression finds."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from discover.laws.base import AbstractConstitutiveLaw
from tensor_library.algebra import Symmetric
from tensor_library.library import TermLibrary


class LibraryExpansion(AbstractConstitutiveLaw):
    """h = Σ cₙ termₙ(σ, γ̇; inner), over a library of candidate terms.

    Attributes
    ----------
    coefficients
        cₙ, one for each term; a zero leaves the term out without recompiling anything.
    inner
        Inner parameters in the order of ``library.inner_names``.
    library
        The terms.
    base
        A known law whose extra term is added, or None.
    """

    coefficients: Float[Array, " n"]
    inner: Float[Array, " m"]
    library: TermLibrary = eqx.field(static=True)
    linear_relaxation: bool = eqx.field(static=True, default=True)
    base: AbstractConstitutiveLaw | None = None

    def extra_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        """Return h = Σ cₙ termₙ(σ, γ̇), plus the base law's."""
        terms = self.library.evaluate(stress, rate, self.inner)
        extra = jnp.tensordot(self.coefficients, terms, axes=1)
        return extra if self.base is None else extra + self.base.extra_term(stress, rate)
