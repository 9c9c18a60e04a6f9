"""The result of comparing two learners on identical data."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from discover.comparison.equations import outcome_equation
from discover.comparison.fitting.classical import ClassicalFit
from discover.comparison.fitting.law_by_mode import LawByMode
from discover.comparison.judging.bands.room_left import room_left
from discover.comparison.judging.explanation import Explanation
from discover.comparison.judging.identifiability import Rival
from discover.comparison.judging.next_measurement import NextMeasurement
from discover.comparison.judging.other_causes.loadings import OwnLoadings
from discover.comparison.judging.statements import IN_LIBRARY, Statement
from discover.comparison.outcomes.flows import (
    Flow,
    Stresses,
    columns_of,
    of_recorded,
    relative_errors,
)
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.comparison.outcomes.range import Placement, place
from discover.effects import KnownEffect
from discover.equations import Equation, equation_to_json
from discover.identify.rivals.bands import PredictionBand
from discover.identify.structure.structure import Structure
from discover.learners.results.term_tables import estimates_of
from discover.notebook_view import table_of
from discover.page_view import PageView
from discover.plain_json import plain
from discover.statistics import FitVerdict
from discover.summary_view import Estimate, SummaryView
from tensor_library.law_terms import LawTerm


@dataclass(frozen=True)
class SweepPoint:
    """One data set of a sweep over laws and a parameter.

    Attributes
    ----------
    law, parameter, value
        What made the data.
    flow
        The test flow.
    outcomes
        By learner.
    """

    law: str
    parameter: str
    value: float
    flow: Flow
    outcomes: Mapping[str, LearnerOutcome]

    def errors(self) -> dict[str, dict[str, float | None]]:
        """Return the errors of each learner in the test flow."""
        return {
            name: relative_errors(outcome.predictions[self.flow.key], self.flow.reference)
            for name, outcome in self.outcomes.items()
        }


@dataclass(frozen=True)
class Comparison(PageView, SummaryView):
    """Both learners beside the known part alone, in the same flows.

    Attributes
    ----------
    name
        Of the study.
    data_summary, known_part
        The data and the known part, in words.
    flows
        Every flow looked at.
    before
        Predictions of the known part alone, by flow.
    outcomes
        By learner.
    truth
        The terms a perfect learner would find, or None.
    noise
        Relative noise of synthetic data, or None.
    rivals, statements
        What the data leave open.
    sweep
        The same again over a parameter.
    distillations
        What simpler laws learn from the true one, JSON-able rows.
    next_measurement
        Bands on the test flows, and what would separate the rivals.
    seed
        Seed of the learners.
    structure
        What the training flows can determine of the library, before any fit; None without the
        sparse learner.
    known
        The known part as an equation; None where it is not wanted.
    explanation
        Whether any law explains the training runs.
    conditions
        Material and temperature, where runs.csv names them.
    by_mode
        The best law whose constants differ from mode to mode; None where none was asked for, or
        one constant for all modes does as well.
    loadings
        The factors on the records of runs that are loadings of their own; None where all are one.
    known_of
        The same for a learner, with the constants that were fitted along with it.
    known_effects
        Effects of the instrument that are known.
    stood_for
        Terms that were not searched, since the constants that are fitted along stand for them.
    classical
        The classical laws fitted to the same runs.
    warnings
        What a reader should know before believing anything else, one sentence each; shown in the
        verdict.
    """

    name: str
    data_summary: str
    known_part: str
    flows: Sequence[Flow]
    before: Mapping[str, Stresses | None]
    outcomes: Mapping[str, LearnerOutcome]
    truth: Sequence[LawTerm] | None
    noise: float | None
    rivals: Sequence[Rival]
    statements: Sequence[Statement]
    sweep: Sequence[SweepPoint] = ()
    distillations: Sequence[Mapping[str, Any]] = ()
    next_measurement: NextMeasurement = field(default_factory=NextMeasurement)
    seed: int = 0
    structure: Structure | None = None
    known: Equation | None = None
    explanation: Explanation = field(default_factory=Explanation)
    classical: Sequence[ClassicalFit] = ()
    warnings: tuple[str, ...] = ()
    known_of: Mapping[str, Equation | None] = field(default_factory=dict)
    known_effects: Sequence[KnownEffect] = ()
    stood_for: tuple[str, ...] = ()
    conditions: str = ""
    by_mode: LawByMode | None = None
    loadings: OwnLoadings | None = None

    _page = "discover.report.in_memory:comparison_page"
    _index = ("learner", "constant")

    def __repr__(self) -> str:
        found = ", ".join(f"{n}: {len(o.terms)} terms" for n, o in self.outcomes.items())
        return f"<Comparison {self.name!r}: {self.verdict}; {found}>"

    def _estimates(self) -> list[Estimate]:
        found = []
        rivals = [set(rival.law.coefficients) for rival in self.rivals]
        for name, outcome in self.outcomes.items():
            left = self.explanation.lack_of_fit.get(name)
            found += estimates_of(outcome.terms, left, rivals, (name,))
            found += [
                Estimate((name, key), one.value, one.ci95, one.unit or "1")
                for key, one in outcome.constants.items()
            ]
        return found

    def to_dataframe(self) -> pd.DataFrame:
        """Return `errors_table` with flow and quantity as columns."""
        return self.errors_table().reset_index()

    @property
    def verdict(self) -> FitVerdict:
        """Whether a law found explains the training runs."""
        return self.explanation.verdict

    @property
    def room_left(self) -> dict[str, float]:
        """Largest difference of N1 and N2 between laws that describe σ12 about as well."""
        misfits = {name: one.misfit for name, one in self.explanation.lack_of_fit.items()}
        told = {name: misfits[name] for name in self.outcomes if name in misfits}
        return room_left(
            self.outcomes, told, self.rivals, [*self.flows_of("training"), *self.judged]
        )

    @property
    def physics(self) -> dict[str, Mapping[str, Any] | None]:
        """Checks of physical soundness by learner."""
        return {name: outcome.physics for name, outcome in self.outcomes.items()}

    @property
    def bands_by_mode(self) -> Mapping[str, PredictionBand]:
        """What the law with constants by mode predicts, by flow; empty if it explains nothing."""
        law = self.by_mode
        return law.bands if law is not None and law.explains and law.rivals_sparse else {}

    def flows_of(self, kind: str) -> list[Flow]:
        """Return the flows of one kind."""
        return [flow for flow in self.flows if flow.kind == kind]

    @property
    def judged(self) -> list[Flow]:
        """Flows that no learner saw and in which something is known."""
        return [flow for flow in self.flows if flow.kind in ("test", "held_out")]

    @property
    def undetermined(self) -> list[str]:
        """Quantities that the data do not decide."""
        return [s.quantity for s in self.statements if s.undetermined]

    @property
    def told_by(self) -> list[dict[str, Any]]:
        """How well each kind of test determines the sparse law; empty if all are of one kind."""
        sparse = self.outcomes.get("tensor_sindy")
        return [] if sparse is None else list(sparse.details.get("told_by", []))

    def placement(self, flow: Flow) -> Placement:
        """Return whether a flow lies inside the range of those that were fitted."""
        return place(flow, self.flows_of("training"))

    def errors(self, who: str, flow: Flow) -> dict[str, float | None]:
        """Return the errors of a learner, or of ``"before"``, in a flow."""
        predictions = self.before if who == "before" else self.outcomes[who].predictions
        return relative_errors(predictions[flow.key], flow.reference)

    def errors_by_mode(self) -> dict[str, dict[str, float | None]]:
        """Return the errors of the law with constants by mode in flows that no fit saw, by run."""
        bands = {} if self.by_mode is None else self.by_mode.bands
        return {
            flow.name: of_recorded(
                relative_errors(columns_of(bands[flow.key].chosen), flow.reference), flow
            )
            for flow in self.judged
            if flow.key in bands
        }

    def outliers(self, who: str, flow: Flow) -> list[int]:
        """Return the samples of a run held out that do not judge a learner."""
        return list(self.explanation.outliers.get(who, {}).get(flow.key, ()))

    def error_without_outliers(self, who: str, flow: Flow) -> float | None:
        """Return a learner's error of σ12 over the samples that judge it; None where all do."""
        samples, predicted = self.outliers(who, flow), self.outcomes[who].predictions[flow.key]
        if not samples or predicted is None:
            return None
        two = (np.delete(of["sigma12"], samples) for of in (predicted, flow.reference))
        return relative_errors(*({"sigma12": column} for column in two))["sigma12"]

    def error_map(self, who: str) -> dict[tuple[float, float], dict[str, float | None]]:
        """Return errors over the Pipkin diagram: (Wi, De) → quantity → relative error.

        Parameters
        ----------
        who
            A learner, or ``"before"``.
        """
        return {
            (flow.amplitude, flow.frequency or 0.0): self.errors(who, flow)
            for flow in self.flows_of("pipkin")
        }

    def terms_table(self) -> pd.DataFrame:
        """Return the terms that each learner found, and the true ones where the law is known."""
        columns: dict[str, dict[str, float]] = {}
        if self.truth is not None:
            columns["truth"] = {t.term: t.coefficient for t in self.truth}
        for name, outcome in self.outcomes.items():
            columns[name] = {t.term: t.coefficient for t in outcome.terms}
        return pd.DataFrame(columns).rename_axis("term")

    def errors_table(self) -> pd.DataFrame:
        """Return relative errors in flows that no fit saw, one line for each flow and quantity."""
        lines = {}
        for flow in self.judged:
            for who in ("before", *self.outcomes):
                for quantity, error in of_recorded(self.errors(who, flow), flow).items():
                    lines.setdefault((flow.name, quantity), {})[who] = error
        table = pd.DataFrame.from_dict(lines, orient="index", dtype=float)
        table.index = pd.MultiIndex.from_tuples(lines, names=["flow", "quantity"])
        return table

    def rivals_table(self) -> pd.DataFrame:
        """Return the laws that the data do not tell from the chosen one, and what would tell."""
        return table_of(self.rivals)

    def _shown(self) -> Iterable[Any]:
        for name, left in self.explanation.lack_of_fit.items():
            yield f"{left.verdict.replace('_', ' ')} by {name}: {left.reason}"
        yield from self.warnings
        for name, outcome in self.outcomes.items():
            yield f"{name}: {outcome.message}"
            if self.known is not None:
                yield self.equation(name)
        yield self.terms_table()
        yield self.errors_table()
        for statement in self.statements:
            open_ = "Not determined by these data"
            said = open_ if statement.undetermined else "Determined if the law is in the library"
            yield f"{said}: {statement.title}. {statement.text}"
        if self.rivals:
            yield "Laws that these data do not tell from the one found by sparse regression:"
            yield self.rivals_table()

    def known_part_of(self, learner: str) -> Equation:
        """Return the known part below what a learner found; upper convected Maxwell if unsaid."""
        return self.known_of.get(learner, self.known) or Equation(())

    def equation(self, learner: str) -> Equation:
        """Return the law that a learner found, with its modes and the box where it was tested."""
        known = self.known_of.get(learner, self.known)
        if known is None:
            raise ValueError("This comparison does not say what its known part is.")
        return outcome_equation(known, self.outcomes[learner], self.flows, self.name)

    def to_json(self) -> dict[str, Any]:
        """Return the comparison as ``comparison.json`` holds it."""
        learners = {}
        for name, outcome in self.outcomes.items():
            learners[name] = {
                "terms": outcome.terms,
                "errors": self._errors(name, self.judged),
                "errors_without_outliers": {
                    flow.name: {
                        "sigma12": self.error_without_outliers(name, flow),
                        "outliers": len(self.outliers(name, flow)),
                    }
                    for flow in self.judged
                    if self.outliers(name, flow)
                },
                "half_widths_of_members": {
                    flow.name: outcome.half_widths(flow) for flow in self.judged
                },
                "training_errors": self._errors(name, self.flows_of("training")),
                "intervals_hold": IN_LIBRARY if self.explanation.in_library else "no",
                "constants": {
                    key: {"value": one.value, "ci95": one.ci95, "unit": one.unit}
                    for key, one in outcome.constants.items()
                },
                "effects": [self._effect(known, outcome) for known in self.known_effects],
                "train_seconds": outcome.train_seconds,
                "message": outcome.message,
                "law": None if self.known is None else equation_to_json(self.equation(name)),
                "details": outcome.details,
            }
        content = {
            "study": self.name,
            **self.explanation.to_json(),
            "data": self.data_summary,
            "conditions": self.conditions,
            "known_part": self.known_part,
            "seed": self.seed,
            "learners": learners,
            "before": {"errors": self._errors("before", self.judged)},
            "pipkin": {
                who: [{"Wi": wi, "De": de, **row} for (wi, de), row in self.error_map(who).items()]
                for who in ("before", *self.outcomes)
            },
            "truth": self.truth,
            "stood_for_by_constants": self.stood_for,
            "classical": {fit.law: fit for fit in self.classical},
            "by_mode": None if self.by_mode is None else self._by_mode(self.by_mode),
            "range": {flow.name: self.placement(flow) for flow in self.judged},
            "loading": None if self.loadings is None else self.loadings.to_json(),
            "rivals": self.rivals,
            "undetermined": self.undetermined,
            "room_left": self.room_left,
            "told_by": self.told_by,
            "warnings": self.warnings,
            "statements": self.statements,
            "structure": self.structure,
            "physics": self.physics,
            "sweep": [
                {"law": p.law, "parameter": p.parameter, "value": p.value, "errors": p.errors()}
                for p in self.sweep
            ],
            "distillation": self.distillations,
            "next_measurement": self.next_measurement,
        }
        return plain(content)

    def _by_mode(self, law: LawByMode) -> dict[str, Any]:
        """Return the law with constants by mode, with the known part that it adds to."""
        known = self.known_of.get("tensor_sindy", self.known)
        return {
            **law.to_json(),
            "errors_by_quantity": self.errors_by_mode(),
            "known_part": None if known is None else equation_to_json(known),
        }

    @staticmethod
    def _effect(known: KnownEffect, outcome: LearnerOutcome) -> dict[str, Any]:
        """Return a known effect as it was with a learner."""
        parameters = {}
        for parameter, value in zip(known.effect.parameters, known.values, strict=True):
            fitted = outcome.constants.get(f"{known.name}.{parameter.name}")
            limits = None if fitted is None else fitted.ci95
            number = value if fitted is None else fitted.value
            parameters[parameter.name] = {"value": number, "ci95": limits, "unit": parameter.unit}
        return {"effect": known.name, "kind": known.effect.kind, "parameters": parameters}

    def _errors(self, who: str, flows: Sequence[Flow]) -> dict[str, dict[str, float | None]]:
        return {flow.name: of_recorded(self.errors(who, flow), flow) for flow in flows}
