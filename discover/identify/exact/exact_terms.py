"""Library terms in exact arithmetic, read off their canonical spelling.

Nothing here goes through floating point: a relation among terms that holds at enough random
integer states holds as an identity between polynomials (a polynomial that vanishes at random
points of a large set is zero, but for a probability of degree over size of the set   [Schwartz
1980, J. ACM 27, 701]).
"""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any, no_type_check

from tensor_library.integrity_basis import TENSOR_NAMES
from tensor_library.invariants import INVARIANT_NAMES
from tensor_library.terms import CandidateTerm

PRIME = 2**61 - 1
"""Modulus of exact arithmetic in residues: a Mersenne prime of one machine word."""


def residue(value: Fraction | int) -> int:
    """Return a fraction modulo the prime."""
    exact = Fraction(value)
    return exact.numerator * pow(exact.denominator, -1, PRIME) % PRIME


Components = tuple[Any, Any, Any, Any]
"""11, 22, 33, 12 of a symmetric tensor in simple shear, over any commutative ring."""


@no_type_check
def _product(first: Sequence[Any], second: Sequence[Any]) -> tuple[Any, ...]:
    """Return a·b of block matrices stored as (11, 22, 33, 12, 21)."""
    a11, a22, a33, a12, a21 = first
    b11, b22, b33, b12, b21 = second
    return (
        a11 * b11 + a12 * b21,
        a21 * b12 + a22 * b22,
        a33 * b33,
        a11 * b12 + a12 * b22,
        a21 * b11 + a22 * b21,
    )


@no_type_check
def _word(word: str, tensors: Mapping[str, Sequence[Any]]) -> tuple[Any, ...]:
    letters = word.split(".")
    value = tuple(tensors[letters[0]])
    for letter in letters[1:]:
        value = _product(value, tensors[letter])
    return value


def exact_terms(
    terms: Sequence[CandidateTerm],
    stress: Components,
    rate: Any,
    one: Any = 1,
    zero: Any = 0,
    form_values: Mapping[str, Any] | None = None,
) -> list[Components]:
    """Return the components of every term at one state.

    `stress`: σ11, σ22, σ33, σ12: integers, fractions, or anything else that adds and multiplies.
    `rate`: γ̇ of the same kind. `one`, `zero`: unit and zero of the ring. `form_values`: value of
    each closed form, by key. A transcendental function of tr σ is algebraically independent of the
    polynomials, so any number stands for it in a search for relations.
    """
    s11, s22, s33, s12 = stress
    tensors = {
        "I": (one, one, one, zero, zero),
        "sigma": (s11, s22, s33, s12, s12),
        "gammadot": (zero, zero, zero, rate, rate),
    }

    # only what the terms need: a product of series is dear
    used = {
        name
        for term in terms
        for name, power in zip(INVARIANT_NAMES, term.powers, strict=True)
        if power
    }
    invariants = {
        name: sum(_word(name.removeprefix("tr(").removesuffix(")"), tensors)[:3], zero)
        for name in used
    }
    bases = {
        name: _sum([_word(word, tensors) for word in name.split("+")])
        for name in dict.fromkeys(TENSOR_NAMES[term.tensor] for term in terms)
    }
    values: list[Components] = []
    for term in terms:
        scalar = one
        for name, power in zip(INVARIANT_NAMES, term.powers, strict=True):
            for _ in range(power):
                scalar = scalar * invariants[name]
        if term.closed_form is not None:
            if form_values is None:
                raise ValueError(f"The term {term.name} is not a polynomial; give form_values.")
            scalar = scalar * form_values[term.closed_form]
        b11, b22, b33, b12, _ = bases[TENSOR_NAMES[term.tensor]]
        values.append((scalar * b11, scalar * b22, scalar * b33, scalar * b12))
    return values


@no_type_check
def _sum(words: list[tuple[Any, ...]]) -> tuple[Any, ...]:
    total = words[0]
    for word in words[1:]:
        total = tuple(a + b for a, b in zip(total, word, strict=True))
    return total
