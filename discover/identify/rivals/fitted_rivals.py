"""After a discovery: which of the laws that were tried the data cannot tell from the chosen one.

The rule
--------
Of all laws that a search refitted, a law is a *rival* if it has no more terms than the chosen one
and the data cannot tell the two apart at 5 % (`compare_residuals`), or if it has one term more,
does not contain the chosen law and predicts every observation to integration error. The noise is
not assumed: it is what the chosen law leaves. Rivals are refitted to the same tolerance as the
chosen law before they are judged. Among laws that the data cannot tell apart the chosen one should
be the simplest: fewest terms, then lowest complexity, then fewest invariants, then the order of the
library; `RivalTable.simplest` says whether it is.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from discover.identify.rivals.evidence import LEVEL, Evidence, compare_residuals
from discover.learners.tensor_sindy.refit import POLISHING, SCREENING, Fit, refit
from discover.learners.tensor_sindy.search import BREADTH, SupportSearch
from discover.notebook_view import SentenceAndTable, table_of
from tensor_library.law_terms import LawTerms, spell

MOST_RIVALS = 8

_PROMISING = 1.25
"""A screened misfit over the chosen one's beyond which a polished refit is not tried."""

_TIED = 1.01
"""A screened misfit over the chosen one's up to which a law may turn out an exact tie."""

_OF_NEAR = 0.1 * SCREENING
"""Relative tolerance of what is no tie, where runs are costly: its misfit ranks it, and no interval
of a constant is as narrow."""

_MOST_POLISHED = 2 * BREADTH


@dataclass(frozen=True)
class FittedRival:
    """A fitted law that the data cannot tell from the chosen one.

    `law`: its terms, refitted.
    `misfit`: relative root-mean-square misfit.
    `difference`: relative root-mean-square difference of its predictions from the chosen law's.
    `evidence`: the test that could not tell them apart.
    `simpler`: whether it comes before the chosen law in the order of simplicity.
    `fit`: the refit itself.
    """

    law: LawTerms
    misfit: float
    difference: float
    evidence: Evidence
    simpler: bool = False
    fit: Fit | None = field(default=None, repr=False)

    @property
    def text(self) -> str:
        """One sentence for a reader."""
        law = spell(self.law.coefficients)
        if self.evidence.test == "tie":
            return f"h = {law} predicts every observation as the chosen law does."
        test = "Vuong's test" if self.evidence.test == "vuong" else "the likelihood-ratio test"
        return (
            f"h = {law} leaves a misfit of {self.misfit:.3g}, and {test} cannot tell it from the "
            f"chosen law (p = {self.evidence.p_value:.2g}, "
            f"{self.evidence.effective_samples:.0f} independent residuals)."
        )

    def line(self) -> dict[str, Any]:
        """Return the rival as one line of a table."""
        return {
            "law": spell(self.law.coefficients),
            "misfit": self.misfit,
            "difference": self.difference,
            "test": self.evidence.test,
            "p_value": self.evidence.p_value,
            "simpler": self.simpler,
        }

    def to_json(self) -> dict[str, Any]:
        """Return the rival as JSON-able values that `from_json` undoes."""
        return {
            **self.law.to_json(),
            "misfit": self.misfit,
            "difference": self.difference,
            "exact": self.evidence.test == "tie",
            "test": self.evidence.test,
            "p_value": self.evidence.p_value,
            "effective_samples": self.evidence.effective_samples,
            "simpler": self.simpler,
            "text": self.text,
        }


@dataclass(frozen=True)
class RivalTable(SentenceAndTable):
    """Every law met that the data cannot tell from the chosen one.

    `rivals`: closest predictions first.
    `tested`: how many laws were tested.
    `simplest`: whether the chosen law is the simplest of them all.
    """

    rivals: tuple[FittedRival, ...] = field(default_factory=tuple)
    tested: int = 0
    simplest: bool = True

    @property
    def text(self) -> str:
        """One sentence for a reader."""
        if not self.rivals:
            return (
                f"If the law is in the library: of {self.tested} other laws tried, none much "
                f"larger, the data rule out every one at {100 * LEVEL:.0f} %."
            )
        ties = sum(r.evidence.test == "tie" for r in self.rivals)
        text = (
            f"If the law is in the library: of {self.tested} other laws tried, the data do not "
            f"rule out {len(self.rivals)} at {100 * LEVEL:.0f} %"
        )
        text += f", of which {ties} predict the same to integration error" if ties else ""
        return text + (
            "; the chosen law is the simplest of them." if self.simplest else "; one is simpler."
        )

    def table(self) -> pd.DataFrame:
        """Return the rivals, one line each, closest predictions first."""
        return table_of(self.rivals)

    def to_json(self) -> dict[str, Any]:
        """Return the table as JSON-able values."""
        return {
            "text": self.text,
            "tested": self.tested,
            "simplest": self.simplest,
            "rivals": [rival.to_json() for rival in self.rivals],
        }


def find_rivals(search: SupportSearch, chosen: Fit) -> RivalTable:
    """Return the rivals of a fit among all that a search refitted, by the rule of this module."""
    problem = search.problem
    seen = problem.records.seen.reshape(-1)
    rows, target = _in_time_order(problem, seen)
    size = len(chosen.support)
    fits = [
        fit
        for fit in search.fits.values()
        if fit.support != chosen.support
        and (
            len(fit.support) <= size
            or (
                len(fit.support) == size + 1
                and not set(chosen.support) <= set(fit.support)
                and fit.misfit <= _PROMISING * chosen.misfit + 10.0 * search.floor
            )
        )
    ]
    limit = _PROMISING * max(chosen.misfit, search.floor)
    near = sorted((f for f in fits if f.misfit <= limit), key=lambda f: f.misfit)[:_MOST_POLISHED]
    polished = {f.support: f for f in _polish(search, near, chosen)}
    residual = chosen.predicted[rows] - target
    order = search.complexity(chosen.support)
    found: list[FittedRival] = []
    for screened in fits:
        fit = polished.get(screened.support, screened)
        nested = size - len(fit.support) if set(fit.support) < set(chosen.support) else 0
        evidence = compare_residuals(
            residual,
            fit.predicted[rows] - target,
            problem.records.run_of_row[rows],
            nested,
            search.floor,
        )
        if evidence.told_apart or (len(fit.support) > size and evidence.test != "tie"):
            continue
        found.append(
            FittedRival(
                fit.law(problem.library),
                fit.misfit,
                float(np.linalg.norm(fit.predicted - chosen.predicted)),
                evidence,
                search.complexity(fit.support) < order,
                fit,
            )
        )
    found.sort(key=lambda rival: rival.difference)
    tested = len(fits) + search.n_ruled_out(size)
    return RivalTable(tuple(found), tested, not any(rival.simpler for rival in found))


def _in_time_order(problem, seen):
    """Return the observed rows, kind after kind so that neighbours are neighbours in time."""
    shape = problem.records.recorded.shape
    index = np.arange(int(np.prod(shape))).reshape(shape).transpose(0, 2, 1).reshape(-1)
    rows = index[seen[index]]
    return rows, problem.records.weighted_record[rows]


def _polish(search: SupportSearch, fits: list[Fit], chosen: Fit) -> list[Fit]:
    """Return fits at their minimum; where runs are costly, those that are no tie less closely."""
    tied = fits
    if search.scout is not None:
        limit = _TIED * chosen.misfit + 10.0 * search.floor
        tied = [fit for fit in fits if fit.misfit <= limit]
    near = [fit for fit in fits if not any(fit is one for one in tied)]
    return [*_refitted(search, tied, POLISHING), *_refitted(search, near, _OF_NEAR)]


def _refitted(search: SupportSearch, fits: list[Fit], tolerance: float) -> list[Fit]:
    if not fits:
        return []
    again = refit(
        search.problem,
        [fit.support for fit in fits],
        [(fit.dense(search.n_terms), fit.inner) for fit in fits],
        search.scale,
        max(search.slots, max(len(fit.support) for fit in fits)),
        tolerance=tolerance,
    )
    return [new if new.misfit <= old.misfit else old for new, old in zip(again, fits, strict=True)]
