"""Combinations of library terms that a shear experiment cannot see, in exact arithmetic."""

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from math import gcd, lcm
from typing import Literal

import numpy as np
from jaxtyping import Float

from discover.identify.exact_series import PRIME, ExactNotation
from tensor_library.law_terms import spell
from tensor_library.library import TermLibrary

_LARGEST_INTEGER = 10**6
_FRESH_STATES = 5
_IDLE_ROWS = 24
_COMPONENTS_SEEN = {"nothing": (0, 1, 2, 3), "33": (0, 1, 3)}

Reach = Literal["nothing", "33"]


@dataclass(frozen=True)
class TermRelation:
    """Combination of terms that vanishes in simple shear, or lives on σ33 only.

    `touches`: ``"nothing"``: zero in every simple shear. ``"33"``: changes σ33 only: N2 sees it,
    σ12 and N1 do not unless the law lets σ33 act back.
    """

    coefficients: Mapping[str, int]  # term → whole number
    touches: Reach


MOST_SPELLED = 4
"""Terms that a sentence bears; more are a table."""


def spell_briefly(coefficients: Mapping[str, float | int]) -> str:
    """Return a sum of terms as `spell` does; of many terms their number and the two largest."""
    if len(coefficients) <= MOST_SPELLED:
        return spell(coefficients)
    largest = sorted(coefficients, key=lambda name: -abs(coefficients[name]))[:2]
    first = spell({name: coefficients[name] for name in largest})
    return f"{first} with {len(coefficients) - 2} smaller terms"


@lru_cache(maxsize=8)
def term_relations(library: TermLibrary) -> tuple[TermRelation, ...]:
    """Return every linear relation among the terms of a library in simple shear.

    Null space at random integer states modulo a large prime, lifted to whole numbers and verified
    without rounding at fresh states. Closed forms are independent of every polynomial. Relations
    that touch nothing come first; each is a basis vector with as few terms as elimination gives.
    """
    generator = random.Random(0)
    n = len(library)
    states = [_random_state(generator, library) for _ in range(n + _FRESH_STATES)]
    values = [_values(library, *state) for state in states]
    found: list[TermRelation] = []
    known: list[list[int]] = []
    for touches, components in _COMPONENTS_SEEN.items():
        rows = [[value[i] for value in at_state] for at_state in values for i in components]
        for vector in _null_space(rows):
            if len(_reduced([*known, vector])[1]) == len(known):  # it is one of these
                continue
            known.append(vector)
            found.append(
                TermRelation(
                    {library.names[i]: c for i, c in enumerate(vector) if c},
                    touches,  # pyright: ignore[reportArgumentType]
                )
            )
    return tuple(found)


def _random_state(generator: random.Random, library: TermLibrary):
    def number() -> int:
        return generator.randint(-_LARGEST_INTEGER, _LARGEST_INTEGER)

    return (
        (number(), number(), number(), number()),
        number(),
        {name: number() for name in library.inner_names},
    )


def _values(library: TermLibrary, stress, rate, forms) -> list[tuple[int, ...]]:
    """Return the components 11, 22, 33, 12 of every term at one state."""
    notation = ExactNotation(stress, rate, forms=forms)
    return [term.spell(notation) for term in library.terms]


def _reduced(rows: Sequence[Sequence[int]]) -> tuple[np.ndarray, list[int]]:
    """Return the reduced row echelon form modulo the prime, and its pivot columns."""
    n = len(rows[0])
    echelon, pivots, idle = np.zeros((0, n), dtype=object), [], 0
    for given in rows:
        row = np.array(given, dtype=object) % PRIME
        row = (row - row[pivots] @ echelon) % PRIME
        leads = np.flatnonzero(row)
        if not len(leads):
            idle += 1
            if idle > _IDLE_ROWS:
                break  # rows come from random states: the rank is reached
            continue
        idle, lead = 0, int(leads[0])
        row = row * pow(row[lead], -1, PRIME) % PRIME
        echelon = np.vstack([(echelon - np.outer(echelon[:, lead], row)) % PRIME, row])
        pivots.append(lead)
        if len(pivots) == n:
            break
    return echelon, pivots


def _null_space(rows: Sequence[Sequence[int]]) -> list[list[int]]:
    # columns in reverse, so that a relation is solved for the later, more complex, terms
    echelon, pivots = _reduced([row[::-1] for row in rows])
    vectors = []
    for free in sorted(set(range(len(rows[0]))) - set(pivots)):
        residues = np.eye(1, len(rows[0]), free, dtype=int)[0].astype(object)
        residues[pivots] = -echelon[:, free] % PRIME
        exact = [part for value in residues[::-1] if (part := _rational(value)) is not None]
        if len(exact) < len(residues):
            continue
        scale = lcm(*(value.denominator for value in exact))
        whole = np.array([int(value * scale) for value in exact], dtype=object)
        last = whole[np.flatnonzero(whole)[-1]]
        whole = whole // gcd(*whole) * (1 if last > 0 else -1)
        if not np.any(np.array(rows, dtype=object) @ whole):
            vectors.append(list(whole))
    return vectors


def _rational(residue: int) -> Fraction | None:
    """Return the small fraction with this residue   [Wang 1981, SYMSAC, 212]."""
    limit = 2**29
    old, new, old_t, new_t = PRIME, residue, 0, 1
    while new > limit:
        quotient = old // new
        old, new = new, old - quotient * new
        old_t, new_t = new_t, old_t - quotient * new_t
    if new_t == 0 or abs(new_t) > limit:
        return None
    return Fraction(new, new_t)


def feels_33(library: TermLibrary) -> bool:
    """Return whether σ33 acts on σ11, σ22 or σ12 through some term of a library.

    If none does, σ33 is invisible to σ12 and N1 in every simple shear. Exact; actions that cancel
    count.
    """
    generator = random.Random(1)
    for _ in range(_FRESH_STATES):
        (s11, s22, s33, s12), rate, forms = _random_state(generator, library)
        # a closed form is a function of tr σ, so it changes with σ33
        other = {name: value + 1 for name, value in forms.items()}
        here = _values(library, (s11, s22, s33, s12), rate, forms)
        there = _values(library, (s11, s22, s33 + 1, s12), rate, other)
        for a, b in zip(here, there, strict=True):
            if (a[0], a[1], a[3]) != (b[0], b[1], b[3]):
                return True
    return False


EXACT = 1e-13
"""Singular value, relative to the largest of unit columns, that counts as zero.

Linear identities commute with Runge–Kutta steps, so exact directions come out at rounding error,
1e-16, and the weakest others well above."""

_ENTRY = 1e-7


@dataclass(frozen=True)
class Direction:
    """Change of the law's coefficients that the observed stresses do not see, to first order.

    Its largest entry is one. `changes`: relative change of σ12, N1, N2 (over N1) per unit.
    `at_any_size`: whether a finite step leaves σ12 as it is too, or only follows the tangent of a
    curve; None where not decided.
    """

    coefficients: Mapping[str, float]  # term → entry
    changes: Mapping[str, float]
    at_any_size: bool | None = None


def unseen_directions(
    names: Sequence[str],
    observed: Float[np.ndarray, "rows n"],
    quantities: Mapping[str, Float[np.ndarray, "_ n"]],
) -> list[Direction]:
    """Return the exact null directions.

    `observed`: sensitivities, a column's norm being the relative rms change per unit of a
    coefficient; `quantities`: of each quantity, likewise.
    """
    norms = np.linalg.norm(observed, axis=0)
    scale = np.where(norms > EXACT * np.max(norms, initial=1.0), norms, 1.0)
    _, values, right = np.linalg.svd(observed / scale, full_matrices=True)
    values = np.concatenate([values, np.zeros(right.shape[0] - values.size)])
    found = []
    for vector in _sparse_basis(right[values <= EXACT * max(values[0], 1e-300)] / scale):
        if not np.any(vector):
            continue  # of fewer samples than terms, elimination may use a direction up
        vector = vector / vector[np.argmax(np.abs(vector))]
        entries = np.flatnonzero(np.abs(vector) > _ENTRY).tolist()
        coefficients = {names[i]: float(np.round(vector[i], 12)) for i in entries}
        sizes = {q: float(np.linalg.norm(block @ vector)) for q, block in quantities.items()}
        found.append(Direction(coefficients, sizes))
    return found


def _sparse_basis(rows: Float[np.ndarray, "k n"]) -> Float[np.ndarray, "k n"]:
    """Return a basis of the same space by elimination, later, more complex terms first."""
    rows = rows / np.max(np.abs(rows), axis=1, keepdims=True, initial=1e-300)
    done: list[int] = []
    for column in range(rows.shape[1] - 1, -1, -1):
        left = [i for i in range(rows.shape[0]) if i not in done]
        if not left:
            break
        pivot = max(left, key=lambda i: abs(rows[i, column]))
        if abs(rows[pivot, column]) < _ENTRY:
            continue
        rows[pivot] = rows[pivot] / rows[pivot, column]
        for i in range(rows.shape[0]):
            if i != pivot:
                rows[i] = rows[i] - rows[i, column] * rows[pivot]
        done.append(pivot)
    rows[np.abs(rows) < _ENTRY] = 0.0
    return rows
