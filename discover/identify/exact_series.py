"""Taylor series of the stress after rest, in exact arithmetic: when two laws agree in shear.

For polynomial histories γ̇(t), which come close to every history, the stress of a polynomial law is
a power series whose coefficients are polynomials. Laws with the same σ12(t) in every history have
the same coefficients for random ones, order by order, without rounding [Fliess 1981, Bull. SMF 109,
3].
"""

import random
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from functools import cache, reduce
from itertools import count, islice
from operator import add
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

    def __init__(self, stress, rate, one=1, zero=0, forms=None):
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


def stress_series(
    law: Mapping[str, Any], rate: Sequence[Fraction | int], linear_relaxation: bool = True
) -> Iterator[list[Any]]:
    """Yield the Taylor coefficients of σ11, σ22, σ33, σ12 after rest, each dearer than the last.

    `law`: term → c of dσ/dt = γ̇ + L·σ + σ·Lᵀ − σ − Σ c term, without closed forms; c may be
    `UNKNOWN`, in which what is yielded is a polynomial of SymPy. `rate`: of γ̇(t) = Σ rate[k] tᵏ.
    """
    from sympy import QQ, ring

    series, t, unknown = ring(f"t,{UNKNOWN}", QQ)

    def exact(value: Any) -> Any:
        return unknown if value == UNKNOWN else QQ(*Fraction(value).as_integer_ratio())

    def coefficient(value: Any, k: int) -> Any:
        return series.from_dict({(0, c): each for (power, c), each in value.items() if power == k})

    terms = [(exact(value), parse_term(name)) for name, value in law.items()]
    shear_rate, stress = series.zero, [series.zero] * 4
    for k in count():
        yield [coefficient(component, k) for component in stress]
        shear_rate += exact(rate[k] if k < len(rate) else 0) * t**k
        notation = ExactNotation(stress, shear_rate, series.one, series.zero)
        grown = 2 * shear_rate * stress[3], shear_rate + shear_rate * stress[1]
        slope = [grown[0], series.zero, series.zero, grown[1]]
        if linear_relaxation:
            slope = [value - old for value, old in zip(slope, stress, strict=True)]
        for c, term in terms:
            components = term.spell(notation)
            slope = [value - c * one for value, one in zip(slope, components, strict=True)]
        further = (coefficient(value, k) * t ** (k + 1) * QQ(1, k + 1) for value in slope)
        stress = [old + new for old, new in zip(stress, further, strict=True)]


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
        both = (stress_series(law, rate, linear_relaxation) for law in (first, second))
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
        polynomial = Poly({(c,): value for (_, c), value in excess.items()}, Symbol(UNKNOWN))
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
