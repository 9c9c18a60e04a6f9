"""Taylor series of the stress after rest, in exact arithmetic: when two laws agree in shear.

For polynomial histories γ̇(t), which come close to every history, the stress of a polynomial law is
a power series whose coefficients are polynomials. Laws with the same σ12(t) in every history have
the same coefficients for random ones, order by order, without rounding [Fliess 1981, Bull. SMF 109,
3].

Coefficients are fractions where values matter, and residues modulo a large prime where only
agreement does, with a chance of a false one of about 1e-17.
"""

import random
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import count, islice, pairwise
from typing import Any, no_type_check

import numpy as np

from tensor_library import INVARIANT_NAMES, TENSOR_NAMES, CandidateTerm, parse_term

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
    terms: Sequence[CandidateTerm], stress: Components, rate: Any, one: Any = 1, zero: Any = 0,
    form_values: Mapping[str, Any] | None = None,
) -> list[Components]:  # fmt: skip
    """Return the components of every term at one state.

    `stress`: σ11, σ22, σ33, σ12, `rate`: γ̇, over any ring with unit `one` and `zero`.
    `form_values`: of each closed form, by key; algebraically independent of polynomials, so any
    number will do.
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


DEFAULT_ORDER = 9
_HISTORIES = 2


@no_type_check  # over any ring, and called too often for a check that could not fail
@dataclass(frozen=True)
class _Series:
    """A power series in time up to an order that products keep; over residues if `modular`."""

    values: tuple[Any, ...]
    modular: bool = False

    def __add__(self, other: "_Series") -> "_Series":
        total = tuple(a + b for a, b in zip(self.values, other.values, strict=True))
        return _Series(total, self.modular)

    def __mul__(self, other: "_Series") -> "_Series":
        n = len(self.values)
        product: list[Any] = [0] * n
        for i, a in enumerate(self.values):
            if a:
                for j in range(n - i):
                    product[i + j] += a * other.values[j]
        if self.modular:
            product = [value % PRIME for value in product]
        return _Series(tuple(product), self.modular)


def stress_series(
    coefficients: Mapping[str, Fraction | int],
    rate: Sequence[Fraction | int],
    order: int,
    linear_relaxation: bool = True,
    modular: bool = False,
) -> list[tuple[Any, Any, Any, Any]]:
    """Return the Taylor coefficients of σ11, σ22, σ33, σ12 after rest, up to an order.

    `coefficients`: term → c of dσ/dt = γ̇ + L·σ + σ·Lᵀ − σ − Σ c term; closed forms raise
    ValueError. `rate`: of γ̇(t) = Σ rate[k] tᵏ. `modular`: whether to return residues modulo
    `PRIME`.
    """
    return list(islice(_growing(coefficients, rate, linear_relaxation, modular), order + 1))


def _growing(
    coefficients: Mapping[str, Fraction | int],
    rate: Sequence[Fraction | int],
    linear_relaxation: bool,
    modular: bool,
) -> Iterator[tuple[Any, Any, Any, Any]]:
    """Yield the Taylor coefficients of `stress_series` one by one, each dearer than the last."""
    number = residue if modular else Fraction
    terms = [parse_term(name) for name in coefficients]
    values = [number(value) for value in coefficients.values()]
    shear_rate: list[Any] = []
    stress: list[tuple[Any, Any, Any, Any]] = [(number(0), number(0), number(0), number(0))]
    for k in count():
        yield stress[k]
        shear_rate.append(number(rate[k] if k < len(rate) else 0))
        zero = _Series((number(0),) * (k + 1), modular)
        one = _Series((number(1), *zero.values[1:]), modular)
        s11, s22, s33, s12 = (_Series(tuple(s[i] for s in stress), modular) for i in range(4))
        g = _Series(tuple(shear_rate), modular)
        slope = [2 * (g * s12).values[k], number(0), number(0), shear_rate[k] + (g * s22).values[k]]
        if linear_relaxation:
            slope = [value - old for value, old in zip(slope, stress[k], strict=True)]
        evaluated = exact_terms(terms, (s11, s22, s33, s12), g, one, zero)
        for c, components in zip(values, evaluated, strict=True):
            slope = [v - c * part.values[k] for v, part in zip(slope, components, strict=True)]
        inverse = number(Fraction(1, k + 1))
        s11, s22, s33, s12 = (
            value * inverse % PRIME if modular else value * inverse for value in slope
        )
        stress.append((s11, s22, s33, s12))


@dataclass(frozen=True)
class Agreement:
    """Order to which two laws agree in every shear history.

    `sigma12`, `N1`, `N2`: first order at which they differ, or None up to `order`.
    """

    order: int  # order to which the series were computed
    sigma12: int | None
    N1: int | None
    N2: int | None


def compare_series(
    first: Mapping[str, Fraction | int],
    second: Mapping[str, Fraction | int],
    order: int = DEFAULT_ORDER,
    linear_relaxation: bool = True,
) -> Agreement:
    """Return where the Taylor series of two laws part, over random histories."""
    generator = random.Random(2)
    parts: dict[str, int | None] = {"sigma12": None, "N1": None, "N2": None}
    for _ in range(_HISTORIES):
        rate = [Fraction(generator.randint(-9, 9), generator.randint(1, 9)) for _ in range(order)]
        a = stress_series(first, rate, order, linear_relaxation, modular=True)
        b = stress_series(second, rate, order, linear_relaxation, modular=True)
        for k, (s, t) in enumerate(zip(a, b, strict=True)):
            for name, same in (
                ("sigma12", s[3] == t[3]),
                ("N1", (s[0] - s[1] - t[0] + t[1]) % PRIME == 0),
                ("N2", (s[1] - s[2] - t[1] + t[2]) % PRIME == 0),
            ):
                known = parts[name]
                if not same and (known is None or k < known):
                    parts[name] = k
    return Agreement(order, parts["sigma12"], parts["N1"], parts["N2"])


def solve_for_coefficient(
    target: Mapping[str, Fraction | int],
    term: str,
    kept: Mapping[str, Fraction | int] | None = None,
    order: int = DEFAULT_ORDER,
    linear_relaxation: bool = True,
) -> list[tuple[float, bool]]:
    """Return every c for which a law with c·term has the σ12 of `target` in every history.

    At the first order at which c enters σ12 it does so as a polynomial of low degree, whose real
    roots are the candidates; a rational root is exact, and then later orders have to agree. `kept`:
    other terms of the law sought. Returns candidates, and whether they are proved.
    """
    generator = random.Random(3)
    rate = [Fraction(generator.randint(1, 9), generator.randint(1, 9)) for _ in range(order)]
    rest = dict(kept or {})

    # residues are enough to see at which order the term enters, and whether it enters too late;
    # fractions are needed at that order only, and no later one at all
    laws = (target, rest, {**rest, term: 1}, {**rest, term: 2})
    series = (_growing(law, rate, linear_relaxation, modular=True) for law in laws)
    for k, states in zip(range(order + 1), zip(*series, strict=True), strict=False):
        wanted, *trial = (state[3] for state in states)
        if trial[0] == trial[1] == trial[2]:
            if trial[0] != wanted:
                return []
            continue
        aim = shear_at(k, target, rate, linear_relaxation)
        samples = [
            shear_at(k, {**rest, term: value}, rate, linear_relaxation) - aim
            for value in range(_DEGREE + 1)
        ]
        polynomial = _interpolate(samples)
        candidates = []
        for root in _real_roots(polynomial):
            fraction = Fraction(root).limit_denominator(10**6)
            if sum(a * fraction**power for power, a in enumerate(polynomial)) != 0:
                candidates.append((root, False))
                continue
            law = {**rest, term: fraction}
            if compare_series(target, law, order, linear_relaxation).sigma12 is None:
                candidates.append((float(fraction), True))
        return candidates
    return []


_DEGREE = 3
"""Degree in its coefficient with which a term first enters σ12, at most."""


def shear_at(
    order: int,
    coefficients: Mapping[str, Fraction | int],
    rate: Sequence[Fraction | int],
    linear_relaxation: bool,
) -> Fraction:
    """Return one Taylor coefficient of σ12."""
    return stress_series(coefficients, rate, order, linear_relaxation)[order][3]


def _interpolate(samples: Sequence[Fraction]) -> list[Fraction]:
    """Return the polynomial with these values at 0, 1, 2, ..., constant first."""
    differences, binomial = list(samples), [Fraction(1)]  # Newton's, times x over k
    polynomial = [Fraction(0)] * len(samples)
    for k in range(len(samples)):
        for power, value in enumerate(binomial):
            polynomial[power] += differences[0] * value
        differences = [later - value for value, later in pairwise(differences)]
        shifted = zip([0, *binomial], [*binomial, 0], strict=True)
        binomial = [(lower - k * value) / Fraction(k + 1) for lower, value in shifted]
    while polynomial and polynomial[-1] == 0:
        polynomial.pop()
    return polynomial


def _real_roots(polynomial: Sequence[Fraction]) -> list[float]:
    """Return the real roots of a polynomial, smallest first."""
    if len(polynomial) < 2:
        return []
    if len(polynomial) == 2:
        return [float(-polynomial[0] / polynomial[1])]
    roots = np.roots([float(value) for value in reversed(polynomial)])
    real = [float(r.real) for r in roots if abs(r.imag) <= 1e-9 * (1.0 + abs(r.real))]
    return sorted(real, key=abs)
