"""What a learner hands on: the same kind of result from both."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float, Num

from discover.equations import Equation, HasEquation, combined, law_parts
from discover.laws.base import AbstractConstitutiveLaw
from discover.learners.results.recovered_term import RecoveredTerm
from discover.learners.results.term_tables import TermTables
from tensor_library.law_terms import spell


@dataclass(frozen=True)
class LearnerResult(HasEquation, TermTables):
    """A learned law and how it was learned.

    Attributes
    ----------
    learner
        Name of the learner.
    law
        The law, dimensionless, ready to simulate.
    terms
        The law, or its projection on a library, term by term.
    train_seconds
        Wall-clock time of `fit`.
    loss_history
        Iterations and losses, both of shape (m,); empty where there is nothing to show.
    details
        What else this learner can say; JSON-able.
    message
        One sentence on how the fit ended.
    members
        Laws that fit the data about as well, this one among them; empty where there is one only.
    """

    learner: str
    law: AbstractConstitutiveLaw
    terms: tuple[RecoveredTerm, ...]
    train_seconds: float = 0.0
    loss_history: tuple[Num[np.ndarray, " m"], Float[np.ndarray, " m"]] = field(
        default_factory=lambda: (np.zeros(0), np.zeros(0))
    )
    details: Mapping[str, Any] = field(default_factory=dict)
    message: str = ""
    members: tuple[AbstractConstitutiveLaw, ...] = ()

    def __repr__(self) -> str:
        terms = spell({t.term: t.coefficient for t in self.terms}) if self.terms else "no term"
        return f"<LearnerResult {self.learner}: {terms}; {self.message}>"

    def equation(self) -> Equation:
        """Return the law term by term, a known law below it included, dimensionless.

        Of a network this is its projection on the library.
        """
        base = getattr(self.law, "base", None)
        found = tuple(term.in_law for term in self.terms)
        named, known = (None, ()) if base is None else law_parts(base)
        # one mode stands for all, but where each has constants of its own
        unit = (1.0,) * (1 if named is None else len(named.constants))
        return Equation(
            combined(known + found) if known else found,
            unit,
            unit,
            linear_relaxation=self.law.linear_relaxation,
            named=named,
        )

    def _shown(self) -> Iterable[Any]:
        yield f"{self.learner}: {self.message}"
        yield self.equation()
        yield self.table()
