"""Libraries of candidate terms."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tensor_library.algebra import (
    IDENTICALLY_ZERO_IN_SHEAR,
    INVARIANT_NAMES,
    TENSOR_NAMES,
    Symmetric,
    integrity_basis,
    scalar_invariants,
)
from tensor_library.closed_forms import CLOSED_FORMS, ClosedForm
from tensor_library.terms import CandidateTerm, parse_term

N_INVARIANTS = len(INVARIANT_NAMES)


@dataclass(frozen=True)
class TermLibrary:
    """Ordered set of candidate terms without repetition, evaluated together; hashable.

    Examples
    --------
    >>> TermLibrary((parse_term("sigma"), parse_term("sigma.sigma"))).names
    ('sigma', 'sigma.sigma')
    """

    terms: tuple[CandidateTerm, ...]

    def __post_init__(self):
        if not self.terms:
            raise ValueError("A library needs at least one term; got none.")
        if len(set(self.terms)) != len(self.terms):
            raise ValueError("A library must not hold a term twice.")

    def __len__(self) -> int:
        return len(self.terms)

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        return hash(self.terms)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Canonical spelling of each term."""
        return tuple(term.name for term in self.terms)

    @cached_property
    def forms(self) -> tuple[ClosedForm, ...]:
        """Closed forms that occur, in the order of their inner parameters."""
        used = {term.closed_form for term in self.terms}
        return tuple(form for name, form in CLOSED_FORMS.items() if name in used)

    @property
    def inner_names(self) -> tuple[str, ...]:
        """Names of the inner parameters that `evaluate` takes."""
        return tuple(form.inner_name for form in self.forms)

    @property
    def inner_default(self) -> Float[np.ndarray, " m"]:
        """Values from which a fit of the inner parameters starts."""
        return np.array([form.inner_default for form in self.forms], dtype=float)

    @property
    def inner_bounds(self) -> tuple[tuple[float, float], ...]:
        """Admissible range of each inner parameter."""
        return tuple(form.inner_bounds for form in self.forms)

    def subset(self, indices: Iterable[int]) -> "TermLibrary":
        """Return the library of some of the terms, in the order given."""
        return TermLibrary(tuple(self.terms[int(i)] for i in indices))

    def extended(self, terms: Iterable[CandidateTerm]) -> "TermLibrary":
        """Return the library with further terms behind its own, each once."""
        return TermLibrary(tuple(dict.fromkeys([*self.terms, *terms])))

    @cached_property
    def _layout(self):
        """Index arrays that make many small products a gather and a product a degree."""
        needed = {(0,) * N_INVARIANTS}
        for powers in (term.powers for term in self.terms):
            while powers not in needed:
                needed.add(powers)
                powers = _parent(powers)[0]
        ranked = sorted(needed, key=sum)
        rank = {powers: i for i, powers in enumerate(ranked)}
        levels = []
        for degree in range(1, sum(ranked[-1]) + 1):
            pairs = [_parent(powers) for powers in ranked if sum(powers) == degree]
            levels.append(tuple(np.array([(rank[p], last) for p, last in pairs]).T))
        form_position = {form.name: 1 + i for i, form in enumerate(self.forms)}
        return (
            levels,
            np.array([rank[term.powers] for term in self.terms]),
            np.array([form_position.get(term.closed_form or "", 0) for term in self.terms]),
            np.array([term.tensor for term in self.terms]),
        )

    def evaluate(
        self, stress: Symmetric, rate: Symmetric, inner: Float[Array, " m"] | None = None
    ) -> Float[Array, "n 3 3"] | Float[Array, "n 4"]:
        """Return the value of every term at one state, shape (n, 3, 3) or (n, 4).

        Parameters
        ----------
        stress, rate, inner
            Dimensionless: both of shape (3, 3) or (4,); `inner_names`, shape (m,), by default the
            forms'.
        """
        levels, monomial_of_term, form_of_term, tensor_of_term = self._layout
        invariants = scalar_invariants(stress, rate)
        monomials = jnp.ones((1,), dtype=invariants.dtype)
        for parents, factors in levels:
            monomials = jnp.concatenate([monomials, monomials[parents] * invariants[factors]])
        scalar = monomials[monomial_of_term]
        if self.forms:
            inner = jnp.asarray(self.inner_default if inner is None else inner)
            values = [
                form.function(invariants[0], inner[i]).astype(invariants.dtype)
                for i, form in enumerate(self.forms)
            ]
            scalar = scalar * jnp.stack([jnp.ones((), invariants.dtype), *values])[form_of_term]
        basis = integrity_basis(stress, rate)[tensor_of_term]
        return scalar.reshape((-1,) + (1,) * stress.ndim) * basis


def _parent(powers: tuple[int, ...]) -> tuple[tuple[int, ...], int]:
    """Return a monomial without its last invariant, and which that is."""
    last = max(i for i, p in enumerate(powers) if p)
    return tuple(p - (i == last) for i, p in enumerate(powers)), last


def build_library(
    tensors: Sequence[str] = TENSOR_NAMES, degree: int = 0, closed_forms: Sequence[str] = (),
    invariants: Sequence[str] | None = None, closed_form_tensors: Sequence[str] = ("sigma",),
    extra: Sequence[str] = (),
) -> TermLibrary:  # fmt: skip
    """Return the library of tensors × invariant monomials up to a degree, plus closed forms.

    Parameters
    ----------
    tensors, invariants, degree
        From `TENSOR_NAMES` and `INVARIANT_NAMES`, by default all that can differ from 0 in shear;
        highest total degree of the invariants, 0 to 4.
    closed_forms, closed_form_tensors, extra
        Keys of `CLOSED_FORMS`, each multiplied with every one of these tensors; further terms in
        canonical spelling. ValueError if a name is unknown, or the degree.

    Examples
    --------
    >>> len(build_library(degree=0)), len(build_library(degree=1, closed_forms=["exp"]))
    (8, 65)
    """
    if isinstance(degree, bool) or not isinstance(degree, int) or not 0 <= degree <= 4:
        raise ValueError(f"degree must be 0 to 4; got {degree!r}. Higher ones are not separable.")
    if invariants is None:
        zero = {INVARIANT_NAMES[i] for i in IDENTICALLY_ZERO_IN_SHEAR}
        invariants = [name for name in INVARIANT_NAMES if name not in zero]
    for given, known, what in (
        (tensors, TENSOR_NAMES, "tensor"),
        (closed_form_tensors, TENSOR_NAMES, "tensor"),
        (invariants, INVARIANT_NAMES, "invariant"),
        (closed_forms, tuple(CLOSED_FORMS), "closed form"),
    ):
        if isinstance(given, str | bytes) or not isinstance(given, Iterable):
            raise ValueError(f"Give a list of names for each {what}; got {given!r}.")
        unknown = [name for name in given if name not in known]
        if unknown:
            raise ValueError(f"Unknown {what} {unknown[0]!r}; known are {', '.join(known)}.")
    positions = [INVARIANT_NAMES.index(name) for name in invariants]
    chosen = (c for d in range(degree + 1) for c in combinations_with_replacement(positions, d))
    monomials = [tuple(one.count(i) for i in range(N_INVARIANTS)) for one in chosen]
    place = TENSOR_NAMES.index
    terms = [CandidateTerm(place(name), powers) for powers in monomials for name in tensors]
    terms += [CandidateTerm(place(name), closed_form=form)
              for form in closed_forms for name in closed_form_tensors]  # fmt: skip
    terms += map(parse_term, extra)
    return TermLibrary(tuple(dict.fromkeys(terms)))
