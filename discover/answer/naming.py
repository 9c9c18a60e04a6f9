"""Laws by name: which named law a sum of terms is, with its constants."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from scipy.optimize import least_squares

from discover.equations.equation import Equation
from discover.laws.base import NamedLaw
from discover.laws.registry import LAWS, starting_values
from tensor_library.law_terms import LawTerm

_SAME = 1e-6  # Relative deviation of coefficients up to which two laws are one


ByMode = tuple[float, ...]  # Of a constant: one value, or that of each mode where these differ


def named_law(equation: Equation) -> tuple[str, dict[str, ByMode]] | None:
    """Return the named law that an equation is, with its constants; None where it is none.

    Examples
    --------
    >>> named_law(Equation((LawTerm("sigma.sigma", 0.2),)))[0]
    'giesekus'
    """
    if equation.states or not equation.linear_relaxation:
        return None
    if equation.named is not None:
        part = equation.named
        first = part.of_mode(0)
        each = {n: part.constants if n in part.differing else (first,) for n in first}
        values = {name: tuple(one[name] for one in modes) for name, modes in each.items()}
        return None if equation.terms else (part.law, values)
    return _of_terms(equation.terms)


def _of_terms(terms: Sequence[LawTerm]) -> tuple[str, dict[str, ByMode]] | None:
    names = tuple(sorted(term.term for term in terms))
    wanted = _numbers(terms)
    for name, law in LAWS.items():
        if _names_of(name, law) != names:
            continue
        start = starting_values(name)
        if not start:
            return name, {}
        low, high = np.transpose(list(law.parameters.values()))

        def off(values, law=law):
            found = _numbers(law.build(*map(float, values)).as_terms() or ())
            return found - wanted if len(found) == len(wanted) else np.full(len(wanted), 1.0)

        inside = np.clip(list(start.values()), low + 1e-9, high - 1e-9)
        found = least_squares(off, inside, bounds=(low, high), xtol=1e-12, ftol=1e-14, gtol=1e-14)
        if np.max(np.abs(found.fun)) <= _SAME * max(float(np.max(np.abs(wanted))), 1e-3):
            return name, {one: (float(v),) for one, v in zip(start, found.x, strict=True)}
    return None


@lru_cache
def _names_of(name: str, law: NamedLaw) -> tuple[str, ...] | None:
    """Return the names of the terms that a law is; None where it is no sum of these."""
    own = law.build(*starting_values(name).values()).as_terms()
    return None if own is None else tuple(sorted(term.term for term in own))


def _numbers(terms: Sequence[LawTerm]) -> np.ndarray:
    """Return coefficients and inner constants, in the order of the terms' names."""
    ordered = sorted(terms, key=lambda term: term.term)
    return np.array([v for t in ordered for v in (t.coefficient, *t.inner.values())], dtype=float)
