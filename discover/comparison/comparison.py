"""Result of comparing learners on identical data."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import pandas as pd

from discover.answer import Answer, HasAnswer
from discover.comparison.classical import ClassicalFit
from discover.comparison.flows import Flow, FlowBand, Stresses, of_recorded, relative_errors
from discover.comparison.hypotheses import terms_named
from discover.comparison.outcome import LearnerOutcome, Placement, place
from discover.comparison.rivals import Rival
from discover.comparison.statements import IN_LIBRARY, Statement, outcome_equation
from discover.effects import KnownEffect
from discover.equations import Equation, equation_to_json
from discover.identify import Structure
from discover.learners.lack_of_fit import FitVerdict, LackOfFit
from discover.learners.results import estimates_of
from discover.loop.loop_result import LoopResult
from discover.plain_numbers import plain
from discover.summary_view import Estimate, PageView, SummaryView, table_of
from tensor_library.law_terms import LawTerm


@dataclass(frozen=True)
class Comparison(PageView, HasAnswer, SummaryView):
    """Both learners and the posterior of the same runs, in the same flows.

    `name`: of the study. `data_summary`, `known_part`: the data and the known part, in words.
    `flows`: every flow looked at. `before`: predictions of the known part alone, by flow.
    `outcomes`: by learner. `posterior`: of the search among laws, effects and terms with the
    learners' proposals. `bands`: predictions of the posterior with their 95 % bands, by the key of
    the flow. `shares`: probability of each learner's law among all fitted, were one of them all
    there is. `truth`: terms that a perfect learner would find, or None. `noise`: relative noise of
    synthetic data, or None.
    `rivals`, `statements`: what the data do not determine. `structure`: what the training flows can
    determine of the library; None where not asked. `classical`: classical laws fitted to the same
    runs. `seed`: of the learners. `known`: known part as an equation; None where it cannot be
    written out. `known_effects`: effects of the instrument that the data were corrected for.
    `conditions`: material and temperature, where runs.csv names them.
    """

    name: str
    data_summary: str
    known_part: str
    flows: Sequence[Flow]
    before: Mapping[str, Stresses | None]
    outcomes: Mapping[str, LearnerOutcome]
    posterior: LoopResult
    bands: Mapping[str, FlowBand] = field(default_factory=dict, repr=False)
    shares: Mapping[str, float] = field(default_factory=dict)
    truth: Sequence[LawTerm] | None = None
    noise: float | None = None
    rivals: Sequence[Rival] = ()
    statements: Sequence[Statement] = ()
    structure: Structure | None = None
    classical: Sequence[ClassicalFit] = ()
    seed: int = 0
    known: Equation | None = None
    known_effects: Sequence[KnownEffect] = ()
    conditions: str = ""

    _page = "discover.report.in_memory:comparison_page"
    _index = ("learner", "constant")

    def __repr__(self) -> str:
        found = ", ".join(f"{n}: {len(o.terms)} terms" for n, o in self.outcomes.items())
        return f"<Comparison {self.name!r}: {self.verdict}; {found}>"

    def _estimates(self) -> list[Estimate]:
        found = []
        laws = [set(rival.law.coefficients) for rival in self.rivals]
        for one in self.posterior.explanations.likeliest_first:
            if one.probability > _POSSIBLE:
                laws += map(terms_named, one.members)
        for name, outcome in self.outcomes.items():
            against = self._against(name)
            found += estimates_of(outcome.terms, outcome.left, laws, (name,), against)
        for one in self.answer.estimates:
            found.append(replace(one, key=("answer", *one.key)))
        return found

    def to_dataframe(self) -> pd.DataFrame:
        """Return `errors_table` with flow and quantity as columns."""
        return self.errors_table().reset_index()

    @property
    def lack_of_fit(self) -> dict[str, LackOfFit]:
        """What each learner's law leaves of the runs that it learned from."""
        return {name: one.left for name, one in self.outcomes.items() if one.left is not None}

    @property
    def verdict(self) -> FitVerdict:
        """Whether a law with a sound or a named instrument describes the runs to the noise."""
        verdict = self.posterior.verdict
        if verdict == "effects_added" or verdict == "no_effect_needed":
            return "explained"
        return verdict

    @property
    def answer(self) -> Answer:
        """The law that one can use, with the errors to be expected of it."""
        return self.posterior.answer

    @property
    def determined_terms(self) -> bool:
        """Whether the sparse law is one that the posterior holds possible."""
        return not self._against("tensor_sindy")

    def _against(self, learner: str) -> str:
        """Return why the posterior does not hold the law of a learner possible; empty if it does.

        Of a network that is the law its terms make: the network itself may fit, and they not.
        """
        if self.verdict != "explained":
            return "no law describes the runs to the noise"
        if self.shares.get(learner, 0.0) <= _POSSIBLE:
            return "the law of these terms is not among the likely ones"
        return ""

    @property
    def disagreement(self) -> dict[str, float]:
        """By how much the network's N1 and N2 are off the posterior's, N2 over N1; the largest."""
        network = self.outcomes.get("tbnn_ude")
        found: dict[str, float] = {}
        for flow in self.unseen_flows:
            if network is None:
                break
            own, band = network.predictions[flow.key], self.bands.get(flow.key)
            if own is None or band is None or not flow.records_shear_stress:
                continue
            for quantity, off in relative_errors(own, band.middle).items():
                if off is not None:
                    found[quantity] = max(found.get(quantity, 0.0), off)
        return found

    @property
    def physics(self) -> dict[str, Mapping[str, Any] | None]:
        """Checks of physical soundness by learner."""
        return {name: outcome.physics for name, outcome in self.outcomes.items()}

    def determined_band(self, flow: Flow) -> FlowBand | None:
        """Return the band of a flow, without limits of what is not determined in it."""
        band = self.bands.get(flow.key)
        if band is None:
            return None
        open_ = [q for q in band.middle if any(s.leaves_open(q, flow) for s in self.statements)]
        return band.limited_to([q for q in band.middle if q not in open_])

    def flows_of(self, kind: str) -> list[Flow]:
        """Return the flows of one kind."""
        return [flow for flow in self.flows if flow.kind == kind]

    @property
    def unseen_flows(self) -> list[Flow]:
        """Flows that no learner saw and in which something is known."""
        return [flow for flow in self.flows if flow.kind in ("test", "held_out")]

    @property
    def undetermined(self) -> list[str]:
        """Quantities that the data do not decide."""
        return [s.quantity for s in self.statements if s.undetermined]

    def placement(self, flow: Flow) -> Placement:
        """Return whether a flow lies inside the range of those that were fitted."""
        return place(flow, self.flows_of("training"))

    def errors(self, who: str, flow: Flow) -> dict[str, float | None]:
        """Return the errors of a learner, or of ``"before"``, in a flow."""
        predictions = self.before if who == "before" else self.outcomes[who].predictions
        return relative_errors(predictions[flow.key], flow.reference)

    def error_map(self, who: str) -> dict[tuple[float, float], dict[str, float | None]]:
        """Return errors of a learner, or ``"before"``: (Wi, De) → quantity → relative error."""
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
        for flow in self.unseen_flows:
            for who in ("before", *self.outcomes):
                for quantity, error in of_recorded(self.errors(who, flow), flow).items():
                    lines.setdefault((flow.name, quantity), {})[who] = error
        table = pd.DataFrame.from_dict(lines, orient="index", dtype=float)
        table.index = pd.MultiIndex.from_tuples(lines, names=["flow", "quantity"])
        return table

    def rivals_table(self) -> pd.DataFrame:
        """Return the laws that the data do not distinguish from the chosen one, and what would."""
        return table_of(self.rivals)

    def _shown(self) -> Iterable[Any]:
        yield from self.answer.lines
        for name, left in self.lack_of_fit.items():
            yield f"{name}: {left.described}"
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

    @property
    def known_or_maxwell(self) -> Equation:
        """The known part below what learners found; upper-convected Maxwell if unsaid."""
        return self.known or Equation(())

    def equation(self, learner: str) -> Equation:
        """Return the law that a learner found, with its modes and the box where it was tested."""
        if self.known is None:
            raise ValueError("This comparison does not say what its known part is.")
        return outcome_equation(self.known, self.outcomes[learner], self.flows, self.name)

    def to_json(self) -> dict[str, Any]:
        """Return the comparison as ``comparison.json`` holds it."""
        learners = {}
        for name, outcome in self.outcomes.items():
            holds = name == "tensor_sindy" and self.determined_terms
            learners[name] = {
                "terms": outcome.terms,
                "errors": self._errors(name, self.unseen_flows),
                "half_widths_of_members": {
                    flow.name: outcome.bands[flow.key].half_widths()
                    for flow in self.unseen_flows
                    if flow.key in outcome.bands
                },
                "training_errors": self._errors(name, self.flows_of("training")),
                "intervals_hold": IN_LIBRARY if holds else "no",
                "probability": self.shares.get(name, 0.0),
                "train_seconds": outcome.train_seconds,
                "message": outcome.message,
                "law": None if self.known is None else equation_to_json(self.equation(name)),
                "details": outcome.details,
            }
        law = self.answer.equation or self.answer.classical
        posterior = self.posterior
        banded = [(flow, band) for flow in self.unseen_flows if (band := self.bands.get(flow.key))]
        content = {
            "study": self.name,
            "verdict": self.verdict,
            "lack_of_fit": self.lack_of_fit,
            "data": self.data_summary,
            "conditions": self.conditions,
            "known_part": self.known_part,
            "declared": posterior.declared,
            "seed": self.seed,
            "learners": learners,
            "before": {"errors": self._errors("before", self.unseen_flows)},
            "posterior": {
                **posterior.explanations.to_json(),
                "constants": posterior.declared_parameters,
                "effects": posterior.stages,
                "errors": {
                    flow.name: of_recorded(relative_errors(band.middle, flow.reference), flow)
                    for flow, band in banded
                },
                "half_widths": {flow.name: band.half_widths() for flow, band in banded},
            },
            "discrepancy": posterior.answer.discrepancy,
            "nearest_law": posterior.nearest_law,
            **posterior.answer.to_json(),
            "answer_law": None if law is None else equation_to_json(law),
            "known_effects": [effect.text for effect in self.known_effects],
            "pipkin": {
                who: [{"Wi": wi, "De": de, **row} for (wi, de), row in self.error_map(who).items()]
                for who in ("before", *self.outcomes)
            },
            "truth": self.truth,
            "classical": {fit.law: fit for fit in self.classical},
            "range": {flow.name: self.placement(flow) for flow in self.unseen_flows},
            "rivals": self.rivals,
            "undetermined": self.undetermined,
            "network_differs_by": self.disagreement,
            "statements": self.statements,
            "structure": self.structure,
            "physics": self.physics,
            "next_measurement": posterior.next_tests.to_json(),
        }
        return plain(content)

    def _errors(self, who: str, flows: Sequence[Flow]) -> dict[str, dict[str, float | None]]:
        return {flow.name: of_recorded(self.errors(who, flow), flow) for flow in flows}


_POSSIBLE = 0.01
"""Probability from which on a law is possible."""
