"""What a learner found and how it chose, as tables."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

import pandas as pd

from discover.learners.results.recovered_term import RecoveredTerm
from discover.notebook_view import NotebookView
from discover.statistics import LackOfFit
from discover.summary_view import Estimate


class TermTables(NotebookView):
    """Tables of a learner's `terms` and `details`, for a fresh result and for one that was kept."""

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

        Columns: relative misfit on all runs, relative misfit on runs left out of the refit
        (``held_out``), log evidence, and which rules choose the law.
        """
        lines = []
        for member in self.details.get("path", ()):
            by = [rule for rule, terms in self._chosen().items() if set(terms) == _support(member)]
            lines.append(
                {
                    "size": member["size"],
                    "terms": ", ".join(member["support"]) or "no term",
                    **{name: member[name] for name in ("misfit", "held_out", "log_evidence")},
                    "chosen_by": ", ".join(by),
                }
            )
        return pd.DataFrame(lines)

    def selectors_table(self) -> pd.DataFrame:
        """Return the terms that each rule for choosing a law takes; empty where there is no path.

        A column for each term that some rule takes, and whether the rule takes it.
        """
        chosen = self._chosen()
        terms = list(dict.fromkeys(term for support in chosen.values() for term in support))
        lines = {rule: [term in support for term in terms] for rule, support in chosen.items()}
        table = pd.DataFrame.from_dict(lines, orient="index", columns=terms, dtype=bool)
        return table.rename_axis("rule")

    def inclusion_table(self) -> pd.DataFrame:
        """Return the probability that each term is in the law, the likeliest first.

        Were the law among those that were fitted. Empty where the learner weighs none.
        """
        found = dict(self.details.get("inclusion") or {})
        return pd.DataFrame({"term": list(found), "probability": list(found.values())})

    def rivals_table(self) -> pd.DataFrame:
        """Return the other laws that the records do not rule out, the closest predictions first.

        Columns: terms, coefficients, relative misfit, relative difference of predictions, log
        evidence, and whether no record of these runs tells the two apart.
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

    def _chosen(self) -> Mapping[str, Sequence[str]]:
        return (self.details.get("selectors") or {}).get("chosen") or {}

    def _shown(self) -> Iterable[Any]:
        yield f"{self.learner}: {self.message}"
        yield self.table()


def estimates_of(
    terms: Sequence[RecoveredTerm],
    left: LackOfFit | None,
    rivals: Iterable[Collection[str]],
    key: tuple[str, ...] = (),
) -> list[Estimate]:
    """Return the coefficients of terms, and whether the data determine each.

    `terms`: of the law. `left`: what the law leaves of the runs; None where that is not known.
    `rivals`: terms of each law that the runs do not tell from it. `key`: what stands before the
    term in the index of a summary.
    """
    rivals = list(rivals)
    found = []
    for term in terms:
        notes = {"determined": _determined(term, left, rivals)}
        found.append(Estimate((*key, term.term), term.coefficient, term.ci95, notes=notes))
        for name, value in term.inner.items():
            ends = term.inner_ci95.get(name)
            found.append(Estimate((*key, f"{name} of {term.term}"), value, ends, notes=notes))
    return found


def _determined(
    term: RecoveredTerm, left: LackOfFit | None, rivals: Iterable[Collection[str]]
) -> str:
    if term.ci95 is None:
        return "no: without interval"
    if left is not None and left.verdict != "explained":
        return "no: the law misses the runs by more than noise"
    if not term.is_told_from_zero:
        return "no: may be zero"
    if any(term.term not in rival for rival in rivals):
        return "no: a law without it fits as well"
    return "yes, if the law is in the library"


def _support(member: Mapping[str, Any]) -> set[str]:
    return set(member["support"])
