"""The truth in the library's words, where the law is known."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from discover.equations import law_terms
from discover.errors import InputError
from discover.laws import make_law


@dataclass(frozen=True)
class TrueTerm:
    """A term that a perfect learner would find.

    Attributes
    ----------
    term, coefficient, inner
        As in `RecoveredTerm`.
    """

    term: str
    coefficient: float
    inner: Mapping[str, float] = field(default_factory=dict)


def true_terms(
    law: str, parameters: Mapping[str, float], known_relaxation: bool
) -> tuple[TrueTerm, ...] | None:
    """Return what is missing from UCM in a named law; None if it is no sum of library terms.

    Parameters
    ----------
    law, parameters
        As in `discover.laws.make_law`.
    known_relaxation
        Whether −σ is known. If not, it is missing too.

    Raises
    ------
    InputError
        If there is no such law, or a parameter is missing or outside its range.
    """
    known = make_law(law, parameters)
    try:
        found = tuple(TrueTerm(t.term, t.coefficient, t.inner) for t in law_terms(known))
    except InputError:
        return None
    return found if known_relaxation else (TrueTerm("sigma", 1.0), *found)
