"""Any law as a law with a name and a sum of terms, where it is one."""

from itertools import permutations

import jax
import numpy as np

from discover.equations.augmented_law import AugmentedLaw
from discover.equations.from_law import combined, law_terms
from discover.equations.named_part import NamedPart
from discover.errors import InputError
from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.each_mode import LawOfEachMode, law_of_mode
from discover.laws.registry import LAWS, name_of
from tensor_library.law_terms import LawTerm

_Named = tuple[str, dict[str, float]]


def law_parts(law: AbstractConstitutiveLaw) -> tuple[NamedPart | None, tuple[LawTerm, ...]]:
    """Return h of a law as a law with a name, where it is no sum of terms, and a sum of terms.

    A law with constants of its own in each mode needs a name.

    Raises InputError if it is neither.
    """
    if law.as_terms() is not None:
        return None, law_terms(law)
    core, added = law.split()
    if isinstance(core, LawOfEachMode):
        part = _of_each_mode(core)
    else:
        named = name_of(core)
        if named is None:
            return None, law_terms(core)
        part = NamedPart(named[0], (named[1],))
    return part, combined(added)


def _of_each_mode(law: LawOfEachMode) -> NamedPart:
    count = len(jax.tree.leaves(law)[0])
    found = [_names_of(law_of_mode(law, number)) for number in range(count)]
    common = [name for name in found[0] if all(name in of for of in found)]
    if not common:
        raise InputError(
            "The law differs from one relaxation mode to the next and has no name, so it cannot be "
            "written out. loop.json and comparison.json have the constants of each mode."
        )
    return NamedPart(common[0], tuple(of[common[0]] for of in found))


def _names_of(law: AbstractConstitutiveLaw) -> dict[str, dict[str, float]]:
    """Return the laws with a name that are the law of a mode, with their constants."""
    named = name_of(law)
    if named is not None:
        return dict([named])
    if not isinstance(law, AugmentedLaw) or law.base.as_terms() != ():
        return {}
    if any(len(values) != 1 for values in law.values):
        return {}
    terms = law_terms(law)
    values = [float(values[0]) for values in law.values]
    found = {}
    for name, other in LAWS.items():
        if len(other.parameters) != len(values):
            continue
        for order in permutations(values):
            built = other.build(*order)
            if (built.as_terms() or ()) and _same(law_terms(built), terms):
                found[name] = dict(zip(other.parameters, order, strict=True))
    return found


def _same(terms: tuple[LawTerm, ...], others: tuple[LawTerm, ...]) -> bool:
    if len(terms) != len(others) or any(t.inner for t in (*terms, *others)):
        return terms == others
    sizes = {t.term: t.coefficient for t in others}
    return all(
        t.term in sizes and bool(np.isclose(t.coefficient, sizes[t.term], rtol=1e-9)) for t in terms
    )
