"""A law as a sum of library terms: what sparse regression finds."""

from collections.abc import Mapping, Sequence

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from discover.laws.base import (
    AbstractConstitutiveLaw,
    AbstractExtendedLaw,
    State,
    as_state,
    stress_in,
)
from tensor_library.algebra import Symmetric
from tensor_library.library import TermLibrary
from tensor_library.terms import TermShare, parse_term


class LibraryExpansion(AbstractExtendedLaw):
    """h = Σ cₙ termₙ(σ, γ̇; inner), over a library of candidate terms.

    Attributes
    ----------
    coefficients
        cₙ, one for each term; a zero leaves the term out without recompiling anything.
    inner
        Inner parameters in the order of ``library.inner_names``.
    base
        A known law whose extra term is added, or None.
    """

    coefficients: Float[Array, " n"]
    inner: Float[Array, " m"]
    library: TermLibrary = eqx.field(static=True)
    linear_relaxation: bool = eqx.field(static=True, default=True)
    base: AbstractConstitutiveLaw | None = None

    def extra_term(self, stress: State, rate: Symmetric) -> State:
        """Return h = Σ cₙ termₙ(σ, γ̇), plus the base law's."""
        terms = self.library.evaluate(stress_in(stress), rate, self.inner)
        extra = as_state(jnp.tensordot(self.coefficients, terms, axes=1), stress)
        return extra if self.base is None else extra + self.base.extra_term(stress, rate)

    def as_terms(self) -> tuple[TermShare, ...] | None:
        """Return the terms whose coefficients differ from zero, behind those of the base law."""
        below = () if self.base is None else self.base.as_terms()
        return None if below is None else below + self._own_terms()

    def split(self) -> tuple[AbstractConstitutiveLaw, tuple[TermShare, ...]]:
        """Return the base law, and the terms."""
        if self.base is None:
            return self, ()
        core, terms = self.base.split()
        return core, terms + self._own_terms()

    def _own_terms(self) -> tuple[TermShare, ...]:
        inner = dict(zip(self.library.inner_names, map(float, self.inner), strict=True))
        return tuple(
            TermShare(term.name, float(value), {name: inner[name] for name in term.inner_names})
            for term, value in zip(self.library.terms, self.coefficients, strict=True)
            if float(value) != 0.0
        )


def law_of_terms(
    names: Sequence[str],
    coefficients: Sequence[float],
    inner: Mapping[str, float],
    linear_relaxation: bool,
    base: AbstractConstitutiveLaw | None = None,
) -> LibraryExpansion:
    """Return the law h = Σ c term from the canonical spelling of its terms.

    Parameters
    ----------
    names, coefficients
        The terms; none means h = 0.
    linear_relaxation
        Whether −σ is part of the known law.
    base
        A known law whose extra term is added.

    Raises
    ------
    ValueError
        If a spelling is not canonical.
    """
    pairs = list(zip(names, coefficients, strict=True)) or [("sigma", 0.0)]
    library = TermLibrary(tuple(parse_term(name) for name, _ in pairs))
    values = [
        inner.get(name, default)
        for name, default in zip(library.inner_names, library.inner_default, strict=True)
    ]
    return LibraryExpansion(
        coefficients=jnp.asarray([c for _, c in pairs], float),
        inner=jnp.asarray(values, float),
        library=library,
        linear_relaxation=linear_relaxation,
        base=base,
    )
