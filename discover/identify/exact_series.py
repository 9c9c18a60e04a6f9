"""Taylor series of the stress after rest, in exact arithmetic: when two laws are the same in shear.

Histories γ̇(t) that are polynomials in time come as close as one likes to every history, and for
each of them the stress of a polynomial law is a power series in time whose coefficients are
polynomials in those of γ̇(t) and of the law. Two laws with the same σ12(t) in every shear history
therefore have the same coefficients for random histories, order by order, without any rounding;
and two that differ show it at a low order   [Fliess 1981, Bull. SMF 109, 3: the same for the
generating series of a control system].
"""

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from discover.identify.exact_terms import exact_terms
from tensor_library.terms import parse_term

DEFAULT_ORDER = 9
_HISTORIES = 2


@dataclass(frozen=True)
class _Series:
    """A power series in time up to an order that products keep."""

    values: tuple[Fraction, ...]

    def __add__(self, other: "_Series") -> "_Series":
        return _Series(tuple(a + b for a, b in zip(self.values, other.values, strict=True)))

    def __mul__(self, other: "_Series") -> "_Series":
        n = len(self.values)
        product = [Fraction(0)] * n
        for i, a in enumerate(self.values):
            if a:
                for j in range(n - i):
                    if other.values[j]:
                        product[i + j] += a * other.values[j]
        return _Series(tuple(product))


def stress_series(
    coefficients: Mapping[str, Fraction | int],
    rate: Sequence[Fraction | int],
    order: int = DEFAULT_ORDER,
    linear_relaxation: bool = True,
) -> list[tuple[Fraction, Fraction, Fraction, Fraction]]:
    """Return the Taylor coefficients of σ11, σ22, σ33, σ12 after rest, up to an order.

    Parameters
    ----------
    coefficients
        The law dσ/dt = γ̇ + L·σ + σ·Lᵀ − σ − Σ c term, dimensionless: term → c. Closed forms are
        not polynomials and raise `ValueError`.
    rate
        Coefficients of γ̇(t) = Σ rate[k] tᵏ.
    order
        Last order.
    linear_relaxation
        Whether −σ is part of the law.
    """
    terms = [parse_term(name) for name in coefficients]
    values = [Fraction(value) for value in coefficients.values()]
    shear_rate = [Fraction(r) for r in rate][:order] + [Fraction(0)] * max(0, order - len(rate))
    stress = [[Fraction(0)] * 4]
    for k in range(order):
        length = k + 1
        zero = _Series((Fraction(0),) * length)
        one = _Series((Fraction(1), *zero.values[1:]))
        s11, s22, s33, s12 = (_Series(tuple(s[i] for s in stress)) for i in range(4))
        g = _Series(tuple(shear_rate[:length]))
        convected = g * s12
        slope = [
            2 * convected.values[k],
            Fraction(0),
            Fraction(0),
            shear_rate[k] + (g * s22).values[k],
        ]
        if linear_relaxation:
            slope = [value - old for value, old in zip(slope, stress[k], strict=True)]
        evaluated = exact_terms(terms, (s11, s22, s33, s12), g, one, zero)
        for c, components in zip(values, evaluated, strict=True):
            slope = [v - c * part.values[k] for v, part in zip(slope, components, strict=True)]
        stress.append([value / (k + 1) for value in slope])
    return [(s[0], s[1], s[2], s[3]) for s in stress]


@dataclass(frozen=True)
class Agreement:
    """To which order two laws agree in every shear history.

    Attributes
    ----------
    order
        Order to which the series were computed.
    sigma12, N1, N2
        First order at which the quantity differs, or None where it agrees to `order`.
    """

    order: int
    sigma12: int | None
    N1: int | None
    N2: int | None


def compare_series(
    first: Mapping[str, Fraction | int],
    second: Mapping[str, Fraction | int],
    order: int = DEFAULT_ORDER,
    linear_relaxation: bool = True,
) -> Agreement:
    """Return where the Taylor series of two laws part, over random histories.

    Parameters
    ----------
    first, second
        The laws, as in `stress_series`.
    order, linear_relaxation
        As in `stress_series`.
    """
    generator = random.Random(2)
    parts: dict[str, int | None] = {"sigma12": None, "N1": None, "N2": None}
    for _ in range(_HISTORIES):
        rate = [Fraction(generator.randint(-9, 9), generator.randint(1, 9)) for _ in range(order)]
        a = stress_series(first, rate, order, linear_relaxation)
        b = stress_series(second, rate, order, linear_relaxation)
        for k, (s, t) in enumerate(zip(a, b, strict=True)):
            for name, same in (
                ("sigma12", s[3] == t[3]),
                ("N1", s[0] - s[1] == t[0] - t[1]),
                ("N2", s[1] - s[2] == t[1] - t[2]),
            ):
                known = parts[name]
                if not same and (known is None or k < known):
                    parts[name] = k
    return Agreement(order, parts["sigma12"], parts["N1"], parts["N2"])


def solve_for_coefficient(
    target: Mapping[str, Fraction | int],
    term: str,
    order: int = DEFAULT_ORDER,
    linear_relaxation: bool = True,
) -> Fraction | None:
    """Return the c for which UCM + c·term has the σ12 of a law in every history, or None.

    The first order at which c enters the series of σ12 is linear in it and gives the candidate; all
    later orders then have to agree.
    """
    generator = random.Random(3)
    rate = [Fraction(generator.randint(1, 9), generator.randint(1, 9)) for _ in range(order)]

    def shear(coefficients: Mapping[str, Fraction | int]) -> list[Fraction]:
        return [s[3] for s in stress_series(coefficients, rate, order, linear_relaxation)]

    wanted, without, unit = shear(target), shear({}), shear({term: 1})
    for want, zero, one in zip(wanted, without, unit, strict=True):
        if one == zero:
            if want != zero:
                return None
            continue
        candidate = (want - zero) / (one - zero)
        agreement = compare_series(target, {term: candidate}, order, linear_relaxation)
        return candidate if agreement.sigma12 is None else None
    return None


def hidden_change(
    first: Mapping[str, Fraction | int],
    second: Mapping[str, Fraction | int],
    order: int = DEFAULT_ORDER,
    linear_relaxation: bool = True,
) -> dict[str, str]:
    """Return the second law's normal stresses as linear functions of the first law's, in words.

    Solved exactly from the Taylor series over two random histories; empty where no linear change
    relates the two. Where the first law confines its stresses (in Johnson–Segalman σ33 = 0 and σ22
    is a multiple of σ11), the change with the fewest terms is one of several.
    """
    generator = random.Random(4)
    states: list[tuple[Fraction, ...]] = []
    images: list[tuple[Fraction, ...]] = []
    for _ in range(_HISTORIES):
        rate = [Fraction(generator.randint(1, 9), generator.randint(1, 9)) for _ in range(order)]
        states += stress_series(first, rate, order, linear_relaxation)
        images += stress_series(second, rate, order, linear_relaxation)
    change = {}
    for row, name in enumerate(_NORMAL):
        solved = _solve_exactly([s[:3] for s in states], [image[row] for image in images])
        if solved is None:
            return {}
        parts = [f"{value} {source}" for value, source in zip(solved, _NORMAL, strict=True) if value]
        change[name] = " + ".join(parts) or "0"
    return change


_NORMAL = ("sigma11", "sigma22", "sigma33")


def _solve_exactly(
    matrix: Sequence[Sequence[Fraction]], right: Sequence[Fraction]
) -> list[Fraction] | None:
    """Return x with matrix x = right, free unknowns zero, or None."""
    n = len(matrix[0])
    rows = [[*row, value] for row, value in zip(matrix, right, strict=True)]
    solution, used = [Fraction(0)] * n, 0
    pivots = []
    for column in range(n):
        pivot = next((i for i in range(used, len(rows)) if rows[i][column]), None)
        if pivot is None:
            continue
        rows[used], rows[pivot] = rows[pivot], rows[used]
        lead = rows[used][column]
        rows[used] = [value / lead for value in rows[used]]
        for i, row in enumerate(rows):
            if i != used and row[column]:
                factor = row[column]
                rows[i] = [a - factor * b for a, b in zip(row, rows[used], strict=True)]
        pivots.append(column)
        used += 1
    if any(row[n] for row in rows[used:]):
        return None
    for i, column in enumerate(pivots):
        solution[column] = rows[i][n]
    return solution
