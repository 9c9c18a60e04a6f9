"""Taylor series of the stress after rest, in exact arithmetic: when two laws agree in shear.

For polynomial histories γ̇(t), which come close to every history, the stress of a polynomial law is
a power series whose coefficients are polynomials. Laws with the same σ12(t) in every history have
the same coefficients for random ones, order by order, without rounding [Fliess 1981, Bull. SMF 109,
3].
"""

import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import cache, reduce
from itertools import count, islice
from operator import add, mul
from typing import Any, no_type_check

from tensor_library import parse_term
from tensor_library.notation import Notation


@no_type_check  # over any ring, and called too often for a check that could not fail
class ExactNotation(Notation):
    """Values at one state of simple shear, tensors stored as (11, 22, 33, 12, 21).

    `stress`: σ11, σ22, σ33, σ12, `rate`: γ̇, over any ring with unit `one` and `zero`. `forms`:
    values of closed forms by inner parameter; they are algebraically independent of polynomials, so
    any number will do.
    """

    def __init__(self, stress, rate, one: Any = 1, zero: Any = 0, forms=None):
        s11, s22, s33, s12 = stress
        self.tensors = {
            "I": (one, one, one, zero, zero),
            "sigma": (s11, s22, s33, s12, s12),
            "gammadot": (zero, zero, zero, rate, rate),
        }
        self.forms = forms or {}
        self.spelled = cache(super().spelled)  # a product of series is dear

    def contraction(self, tensors):
        return reduce(_product, tensors)

    def sum(self, summands):
        return tuple(reduce(add, each) for each in zip(*summands, strict=True))

    def trace(self, tensor):
        return tensor[0] + tensor[1] + tensor[2]

    def power(self, scalar, exponent):
        return scalar**exponent

    def letter(self, name):
        return name  # by which `forms` has the value of its form

    def exponential(self, rate, trace):
        return self.forms[rate]

    def saturating(self, level, trace):
        return self.forms[level]

    def function(self, expression, trace, parameter):
        return self.forms[parameter]

    def product(self, factors):
        *scalars, (b11, b22, b33, b12, _) = factors
        for scalar in scalars:
            b11, b22, b33, b12 = scalar * b11, scalar * b22, scalar * b33, scalar * b12
        return b11, b22, b33, b12


@no_type_check
def _product(first: Sequence[Any], second: Sequence[Any]) -> tuple[Any, ...]:
    """Return a·b of block matrices."""
    a11, a22, a33, a12, a21 = first
    b11, b22, b33, b12, b21 = second
    return (
        a11 * b11 + a12 * b21,
        a21 * b12 + a22 * b22,
        a33 * b33,
        a11 * b12 + a12 * b22,
        a21 * b11 + a22 * b21,
    )


DEFAULT_ORDER = 9
_HISTORIES = 2

UNKNOWN = "c"
"""A coefficient of a law that is solved for."""


PRIME = 2**61 - 1
"""Modulus of exact arithmetic in residues, one machine word: two numbers that differ agree modulo
it once in 10^18 times."""


@no_type_check  # as above
class _Series:
    """Power series in time up to an order, over any ring, or of whole numbers modulo a prime."""

    def __init__(self, values, modulus=None):
        self.values = [value % modulus for value in values] if modulus else list(values)
        self.modulus = modulus

    def __add__(self, other):
        return _Series(map(add, self.values, other.values), self.modulus)

    def __mul__(self, other):
        # what is of a higher order is not asked for
        first, second = self.values, other.values
        products = (sum(map(mul, first, second[k::-1])) for k in range(len(first)))
        return _Series(products, self.modulus)

    def __pow__(self, exponent):
        return reduce(mul, [self] * exponent)


def stress_series(
    law: Mapping[str, Any],
    rate: Sequence[Fraction | int],
    linear_relaxation: bool = True,
    modulus: int | None = None,
) -> Iterator[list[Any]]:
    """Yield the Taylor coefficients of σ11, σ22, σ33, σ12 after rest, each dearer than the last.

    `law`: term → c of dσ/dt = γ̇ + L·σ + σ·Lᵀ − σ − Σ c term, without closed forms; c may be
    `UNKNOWN`. `rate`: of γ̇(t) = Σ rate[k] tᵏ. `modulus`: a prime modulo which whole numbers are
    yielded; else they are polynomials of SymPy in what is unknown.
    """
    exact = _into_ring(modulus)
    zero, one = exact(0), exact(1)
    terms = [(exact(value), parse_term(name)) for name, value in law.items() if value]
    rates: list[Any] = []
    stress: list[list[Any]] = [[zero] for _ in range(4)]
    for k in count():
        now = [_Series(component, modulus) for component in stress]
        yield [component.values[k] for component in now]
        rates.append(exact(rate[k] if k < len(rate) else 0))
        given = rates, [one] + k * [zero], (k + 1) * [zero]
        shear_rate, *units = (_Series(values, modulus) for values in given)
        notation = ExactNotation(now, shear_rate, *units)
        stretched, turned = ((shear_rate * now[at]).values[k] for at in (3, 1))
        slope = [2 * stretched, zero, zero, rates[k] + turned]
        if linear_relaxation:
            slope = [value - old.values[k] for value, old in zip(slope, now, strict=True)]
        for c, term in terms:
            pairs = zip(slope, term.spell(notation), strict=True)
            slope = [value - c * component.values[k] for value, component in pairs]
        for component, value in zip(stress, slope, strict=True):
            component.append(value * exact(Fraction(1, k + 1)))


def _into_ring(modulus: int | None) -> Callable[[Any], Any]:
    """Return what makes a rational number one of the ring of `stress_series`."""
    if modulus is not None:
        return lambda value: value.numerator * pow(value.denominator, -1, modulus) % modulus
    from sympy import QQ, ring

    polynomials, unknown = ring(UNKNOWN, QQ)

    def exact(value: Any) -> Any:
        if value == UNKNOWN:
            return unknown
        return polynomials(QQ(*Fraction(value).as_integer_ratio()))

    return exact


def same_shear_stress(
    first: Mapping[str, Fraction | int],
    second: Mapping[str, Fraction | int],
    order: int = DEFAULT_ORDER,
    linear_relaxation: bool = True,
) -> bool:
    """Return whether σ12 of two laws agrees to an order of time, in random histories."""
    generator = random.Random(2)
    for _ in range(_HISTORIES):
        rate = [Fraction(generator.randint(-9, 9), generator.randint(1, 9)) for _ in range(order)]
        both = (stress_series(law, rate, linear_relaxation, PRIME) for law in (first, second))
        if any(a[3] != b[3] for a, b in islice(zip(*both, strict=True), order + 1)):
            return False
    return True


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
    from sympy import Poly, Symbol

    generator = random.Random(3)
    rate = [Fraction(generator.randint(1, 9), generator.randint(1, 9)) for _ in range(order)]
    law = {**(kept or {}), term: UNKNOWN}
    both = (stress_series(each, rate, linear_relaxation) for each in (target, law))
    for wanted, found in islice(zip(*both, strict=True), order + 1):
        excess = found[3] - wanted[3]
        if excess.is_ground:
            if excess:
                return []
            continue
        polynomial = Poly({(c,): value for (c,), value in excess.items()}, Symbol(UNKNOWN))
        candidates = []
        roots: set[Any] = set(polynomial.real_roots())
        for root in sorted(roots, key=lambda one: abs(float(one))):
            if not root.is_Rational:
                candidates.append((float(root), False))
                continue
            proved = {**law, term: Fraction(root.p, root.q)}
            if same_shear_stress(target, proved, order, linear_relaxation):
                candidates.append((float(root), True))
        return candidates
    return []
