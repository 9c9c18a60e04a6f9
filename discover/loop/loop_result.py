"""What a closed loop found, for people, pictures and other programs."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from discover.answer import Answer, HasAnswer
from discover.equations import (
    Equation,
    HasEquation,
    equation_to_json,
)
from discover.errors import InputError
from discover.loop.answering import loop_answer
from discover.loop.findings import LoopFindings
from discover.plain_numbers import plain
from discover.summary_view import Estimate, PageView, SummaryView
from discover.words import percent_of


@dataclass(frozen=True)
class LoopResult(LoopFindings, PageView, HasEquation, HasAnswer, SummaryView):
    """The outcome of a closed loop: what it found, with its answer, equation, tables and files."""

    _page = "discover.report.in_memory:loop_page"

    def __repr__(self) -> str:
        added = ", ".join(stage.effect for stage in self.stages) or "no effect"
        fit, held = self.error_after.fit, self.error_after.held_out
        judged = "" if held is None else f", held out {percent_of(held)}"
        return f"<LoopResult: {self.verdict}; {added}; error {percent_of(fit)}{judged}>"

    @cached_property
    def answer(self) -> Answer:
        """The law that one can use, how good it is, where, and what to measure next."""
        return loop_answer(self)

    def equation(self) -> Equation:
        """Return the augmented fluid as an equation, with its error and range in the notes.

        Raises InputError if an effect gives the fluid a state that nobody wrote out, or adds what
        is no sum of library terms, or if what it adds differs from mode to mode.
        """
        return self.answer.equation or self.without_answer()

    @property
    def held_in_band(self) -> float | None:
        """Share of held-out samples inside the band of all explanations; None without any."""
        inside = [
            (record.band[0] <= record.measured) & (record.measured <= record.band[1])
            for record in self.records
            if record.held_out and record.band is not None
        ]
        return float(np.mean(np.concatenate(inside))) if inside else None

    def to_dataframe(self) -> pd.DataFrame:
        """Return the effects that were added, one line for each of their parameters."""
        lines = []
        for number, stage in enumerate(self.stages, 1):
            for name, p in stage.parameters.items():
                line = {"stage": number, "effect": stage.effect, "kind": stage.kind}
                line |= {"parameter": name, "value": p.value, "unit": p.unit}
                line |= {"low": p.ci95[0], "high": p.ci95[1]}
                line |= {"error_fit": stage.error.fit, "error_held_out": stage.error.held_out}
                lines.append({**line, "aliases": ", ".join(stage.aliases)})
        columns = ["stage", "effect", "kind", "parameter", "value", "unit", "low", "high"]
        return pd.DataFrame(lines, columns=[*columns, "error_fit", "error_held_out", "aliases"])

    def _estimates(self) -> list[Estimate]:
        return self.answer.estimates

    def errors_table(self) -> pd.DataFrame:
        """Return the mean relative errors before and after, on fitted and on held-out runs."""
        pairs = {"before": asdict(self.error_before), "after": asdict(self.error_after)}
        return pd.DataFrame(pairs, dtype=float).T.rename_axis("error")

    def _shown(self) -> Iterable[Any]:
        yield from self.answer.lines
        yield self.errors_table()
        yield self.to_dataframe()
        try:
            yield self.equation()
        except InputError as error:
            yield str(error)

    def _law(self) -> dict[str, Any]:
        try:
            return {"law": equation_to_json(self.equation())}
        except InputError as error:
            return {"law": None, "law_missing": str(error)}

    @property
    def declared(self) -> dict[str, Any] | None:
        """Declared law and effects as fitted, as result files hold them for ``[model] from``.

        None of a simple material, which has no such law.
        """
        if self.material is not None:
            return None
        law = self.declared_law
        return {
            "law": None if law is None else equation_to_json(law),
            "effects": self.declared_effects,
            "by_mode": self.differing_by_mode,
        }

    def to_json(self) -> dict[str, Any]:
        """Return the contents of ``loop.json``."""
        contents = {
            "verdict": self.verdict,
            "error_before": self.error_before,
            "error_after": self.error_after,
            "noise_floor": self.noise_floor,
            "stages": self.stages,
            "remaining": self.remaining,
            "declared": self.declared,
            "declared_parameters": self.declared_parameters,
            "ranking": self.rankings,
            "runs": {
                record.name: {"held_out": record.held_out, "errors": record.errors}
                for record in self.records
            },
            **self.explanations.to_json(),
            "next_tests": self.next_tests,
            "held_out_in_band": self.held_in_band,
            "laws": self.laws,
            "free_form": self.free_form,
            "discrepancy": self.answer.discrepancy,
            "spread_of_laws": self.spread_of_laws,
            "nearest_law": self.nearest_law,
            **self.answer.to_json(),
            "folds": self.folds,
            "seconds": self.seconds,
            **self._law(),
        }
        return plain(contents)
