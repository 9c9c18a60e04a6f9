"""Laws as sums of library terms, as sparse regression finds them."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from discover.laws.base import AbstractConstitutiveLaw, AbstractExtendedLaw
from discover.laws.tensor_basis_network import TensorBasisNetwork
from discover.programs import on_device
from tensor_library import LawTerm, LawTerms, TermLibrary, build_library, parse_term
from tensor_library.algebra import Symmetric


class LibraryExpansion(AbstractExtendedLaw):
    """h = Σ cₙ termₙ(σ, γ̇; inner), over a library of candidate terms.

    `coefficients`: cₙ; a zero leaves a term out without recompiling.
    """

    coefficients: Float[Array, " n"]
    inner: Float[Array, " m"]  # inner parameters in the order of ``library.inner_names``
    library: TermLibrary = eqx.field(static=True)
    linear_relaxation: bool = eqx.field(static=True, default=True)
    base: AbstractConstitutiveLaw | None = None  # a known law whose extra term is added, or None

    def own_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        """Return Σ cₙ termₙ(σ, γ̇)."""
        terms = self.library.evaluate(stress, rate, self.inner)
        return jnp.tensordot(self.coefficients, terms, axes=1)

    def own_terms(self) -> tuple[LawTerm, ...]:
        """Return the terms whose coefficients differ from zero."""
        inner = dict(zip(self.library.inner_names, np.asarray(self.inner).tolist(), strict=True))
        return tuple(
            LawTerm(term.name, float(value), {name: inner[name] for name in term.inner_names})
            for term, value in zip(self.library.terms, np.asarray(self.coefficients), strict=True)
            if float(value) != 0.0
        )


def law_of_terms(
    terms: LawTerms, linear_relaxation: bool, base: AbstractConstitutiveLaw | None = None
) -> LibraryExpansion:
    """Return the law h = Σ c term, added to the extra term of `base`.

    Raises ValueError if a spelling is not canonical.
    """
    library = TermLibrary(tuple(map(parse_term, terms.coefficients or ["sigma"])))
    return expansion_of(terms, library, linear_relaxation, base)


def expansion_of(
    terms: LawTerms,
    library: TermLibrary,
    linear_relaxation: bool,
    base: AbstractConstitutiveLaw | None = None,
) -> LibraryExpansion:
    """Return the law of some terms of a library, added to the extra term of `base`."""
    coefficients, inner = map(on_device, terms.over(library))
    return LibraryExpansion(
        coefficients=coefficients, inner=inner, library=library,
        linear_relaxation=linear_relaxation, base=base,
    )  # fmt: skip


# terms searched for by default, so that what is found shares programs with what is known
_SHARED = build_library(degree=1)


def in_shared_form(law: AbstractConstitutiveLaw) -> AbstractConstitutiveLaw:
    """Return a plain sum of terms of degree one as an expansion on all: programs are shared."""
    if not _is_plain(law) or any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(law)):
        return law
    if isinstance(law, TensorBasisNetwork) and np.any(np.asarray(law.network_mask) != 0):
        return law
    terms = law.as_terms()
    if terms is None or any(term.term not in _SHARED.names for term in terms):
        return law
    coefficients = np.zeros(len(_SHARED))
    for term in terms:
        coefficients[_SHARED.names.index(term.term)] += term.coefficient
    return LibraryExpansion(
        coefficients=on_device(coefficients),
        inner=on_device(np.zeros(0)),
        library=_SHARED,
        linear_relaxation=law.linear_relaxation,
    )


def _is_plain(law: AbstractConstitutiveLaw) -> bool:
    """Return whether a law of this package says all that it does by h."""
    below = law.base if isinstance(law, AbstractExtendedLaw) else None
    own = (AbstractConstitutiveLaw.conformation, AbstractExtendedLaw.conformation)
    return (
        type(law).__module__.partition(".")[0] == "discover"
        and type(law).conformation in own
        and not law.variables
        and not law.retracts
        and (below is None or _is_plain(below))
    )
