"""The truth in the library's words, where the law is known."""

from collections.abc import Mapping

from discover.equations import law_terms
from discover.errors import InputError
from discover.laws import make_law
from tensor_library.law_terms import LawTerm


def true_terms(
    law: str, parameters: Mapping[str, float], known_relaxation: bool
) -> tuple[LawTerm, ...] | None:
    """Return what is missing from UCM in a named law; None if it is no sum of library terms.

    `known_relaxation`: whether −σ is known. If not, it is missing too. Raises InputError if there
    is no such law, or a parameter is missing or outside its range.
    """
    known = make_law(law, parameters)
    try:
        found = law_terms(known)
    except InputError:
        return None
    return found if known_relaxation else (LawTerm("sigma", 1.0), *found)
