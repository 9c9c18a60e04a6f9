"""Laws of this package as sums of library terms, where they are one."""

import numpy as np

from discover.effects.base import ConstitutiveEffect
from discover.errors import InputError
from discover.laws.base import AbstractConstitutiveLaw
from tensor_library.closed_forms import CLOSED_FORMS
from tensor_library.law_terms import LawTerm

EXPONENTIAL = f"{CLOSED_FORMS.present['exp'].spelling}*sigma"


def law_terms(law: AbstractConstitutiveLaw) -> tuple[LawTerm, ...]:
    """Return h of a law as a sum of terms."""
    terms = law.as_terms()
    if terms is None:
        raise InputError(
            f"A law of the kind {type(law).__name__} is no sum of library terms, so it cannot be "
            "written out. Register it under a name with dc.register_law, or give the class the "
            "method as_terms if it is such a sum."
        )
    return combined(terms)


def effect_terms(effect: ConstitutiveEffect, values: np.ndarray) -> tuple[LawTerm, ...]:
    """Return what a constitutive effect adds to h as a sum of terms.

    `values`: its parameters in their order, shape (p,).
    """
    terms = effect.as_terms([float(value) for value in values])
    if terms is None:
        raise InputError(
            f"What the effect {effect.name!r} adds is no sum of library terms, so the law cannot "
            "be written out. Its equation and parameters are in loop.json and equations.tex."
        )
    return terms


def combined(terms: tuple[LawTerm, ...]) -> tuple[LawTerm, ...]:
    """Return the sum with equal terms added up, in the order of their first appearance."""
    found: dict[tuple, LawTerm] = {}
    for term in terms:
        key = (term.term, tuple(sorted(term.inner.items())))
        if key in found:
            total = found[key].coefficient + term.coefficient
            found[key] = LawTerm(term.term, total, term.inner)
        else:
            found[key] = term
    return tuple(found.values())
