"""The truth in the library's words, where the law is known."""

from collections.abc import Mapping
from dataclasses import dataclass, field


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
    """Return what is missing from UCM in a named law; None if the library does not hold it.

    Parameters
    ----------
    law, parameters
        As in `discover.laws.make_law`.
    known_relaxation
        Whether −σ is known. If not, it is missing too.
    """
    found: tuple[TrueTerm, ...]
    if law == "ucm":
        found = ()
    elif law == "johnson_segalman":
        found = (TrueTerm("sigma.gammadot+gammadot.sigma", parameters["xi"] / 2.0),)
    elif law == "giesekus":
        found = (TrueTerm("sigma.sigma", parameters["alpha"]),)
    elif law == "ptt_linear":
        found = (TrueTerm("tr(sigma)*sigma", parameters["epsilon"]),)
    elif law == "ptt_exponential":
        inner = {"epsilon": parameters["epsilon"]}
        found = (TrueTerm("(exp(epsilon*tr(sigma))-1)*sigma", 1.0, inner),)
    else:
        return None
    return found if known_relaxation else (TrueTerm("sigma", 1.0), *found)
