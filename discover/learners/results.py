"""Results of learners: the law term by term, and tables."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import pandas as pd

from discover.equations import Equation, HasEquation, combined, law_parts
from discover.laws.base import AbstractConstitutiveLaw
from discover.learners.files import kept_in_files
from discover.learners.lack_of_fit import LackOfFit
from discover.summary_view import Estimate, NotebookView
from tensor_library.law_terms import Interval, LawTerm, spell


@kept_in_files
@dataclass(frozen=True)
class RecoveredTerm(LawTerm):
    """Term of a recovered law: a `LawTerm`, and what the learner knows beyond it.

    `coefficient`: refitted without penalty. `coefficient_penalised`: of the penalised problem that
    selected the term, if any. `latex`: the term without its coefficient. `inner_ci95`: of the inner
    parameters.
    """

    coefficient_penalised: float | None = field(default=None, kw_only=True)
    latex: str = field(default="", kw_only=True)
    inner_ci95: Mapping[str, Interval] = field(default_factory=dict, kw_only=True)

    @property
    def excludes_zero(self) -> bool:
        """Whether its interval excludes zero."""
        return self.ci95 is not None and not self.ci95[0] <= 0.0 <= self.ci95[1]

    @property
    def in_law(self) -> LawTerm:
        """The term as an equation holds it."""
        return LawTerm(self.term, self.coefficient, self.inner, self.ci95)

    def to_json(self) -> dict[str, Any]:
        """Return everything as JSON-able values; `from_json` undoes it."""
        first = dict.fromkeys(("term", "coefficient", "coefficient_penalised", "ci95"))
        return first | {one.name: getattr(self, one.name) for one in fields(self)}


class TermTables(NotebookView):
    """Tables of a learner's `terms` and `details`."""

    learner: str
    terms: tuple[RecoveredTerm, ...]
    details: Mapping[str, Any]
    message: str

    def table(self) -> pd.DataFrame:
        """Return the terms with their coefficients and 95 % intervals, one line each."""
        columns = ["term", "coefficient", "low", "high", "penalised", "inner"]
        lines = []
        for t in self.terms:
            low, high = (None, None) if t.ci95 is None else t.ci95
            inner = ", ".join(f"{name} = {value:.6g}" for name, value in t.inner.items())
            lines.append((t.term, t.coefficient, low, high, t.coefficient_penalised, inner))
        return pd.DataFrame(lines, columns=columns)

    def path_table(self) -> pd.DataFrame:
        """Return the best law of each size, from no term on; empty where the learner has no path.

        Columns: relative misfit on all runs and on runs left out (``held_out``), log evidence, by
        which a law is chosen.
        """
        lines = [
            {
                "size": member["size"],
                "terms": ", ".join(member["support"]) or "no term",
                **{name: member[name] for name in ("misfit", "held_out", "log_evidence")},
            }
            for member in self.details.get("path", ())
        ]
        return pd.DataFrame(lines)

    def inclusion_table(self) -> pd.DataFrame:
        """Return the probability of each term, were the law among those fitted."""
        found = dict(self.details.get("inclusion") or {})
        return pd.DataFrame({"term": list(found), "probability": list(found.values())})

    def rivals_table(self) -> pd.DataFrame:
        """Return the other laws that the records do not rule out, the closest predictions first.

        Columns: terms, coefficients, relative misfit, relative difference of predictions, log
        evidence, and whether no record distinguishes the two.
        """
        lines = [
            {
                "terms": ", ".join(row["support"]) or "no term",
                "coefficients": ", ".join(f"{value:.4g}" for value in row["coefficients"]),
                **{name: row[name] for name in ("misfit", "difference", "log_evidence", "exact")},
            }
            for row in self.details.get("rivals", ())
        ]
        return pd.DataFrame(lines)

    def _shown(self) -> Iterable[Any]:
        yield f"{self.learner}: {self.message}"
        yield self.table()


def estimates_of(
    terms: Sequence[RecoveredTerm],
    left: LackOfFit | None,
    rivals: Iterable[Collection[str]],
    key: tuple[str, ...] = (),
    against: str = "",
) -> list[Estimate]:
    """Return the coefficients of terms, and whether the data determine each.

    `left`: lack of fit of the law; None if unknown. `rivals`: terms of laws that the runs do not
    exclude. `key`: index levels before the term. `against`: what else speaks against the law.
    """
    rivals = list(rivals)
    found = []
    for term in terms:
        notes = {"determined": _determined(term, left, rivals, against)}
        found.append(Estimate((*key, term.term), term.coefficient, term.ci95, notes=notes))
        for name, value in term.inner.items():
            ends = term.inner_ci95.get(name)
            found.append(Estimate((*key, f"{name} of {term.term}"), value, ends, notes=notes))
    return found


def _determined(
    term: RecoveredTerm, left: LackOfFit | None, rivals: Iterable[Collection[str]], against: str
) -> str:
    if term.ci95 is None:
        return "no: without interval"
    if left is not None and left.verdict != "explained":
        return "no: the law misses the runs by more than noise"
    if against:
        return f"no: {against}"
    if not term.excludes_zero:
        return "no: may be zero"
    if any(term.term not in rival for rival in rivals):
        return "no: a law without it fits as well"
    return "yes, if the law is in the library"


@kept_in_files
@dataclass(frozen=True)
class LearnerResult(HasEquation, TermTables):
    """Learned law and how it was learned.

    `members`: laws that fit the data about as well, this one among them; empty where there is one
    only.
    """

    learner: str  # name of the learner
    law: AbstractConstitutiveLaw  # dimensionless, ready to simulate
    terms: tuple[RecoveredTerm, ...]  # the law, or its projection on a library
    train_seconds: float = 0.0  # wall-clock time of `fit`
    details: Mapping[str, Any] = field(default_factory=dict)  # what else it can say; JSON-able
    message: str = ""  # how the fit ended
    members: tuple[AbstractConstitutiveLaw, ...] = ()

    def __repr__(self) -> str:
        terms = spell({t.term: t.coefficient for t in self.terms}) if self.terms else "no term"
        return f"<LearnerResult {self.learner}: {terms}; {self.message}>"

    def equation(self) -> Equation:
        """Return the law with a known law below it, dimensionless; of a network its projection."""
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
