"""The sections of a comparison's page: a heading and parts, each drawn by itself."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from markupsafe import Markup

from discover.comparison.comparison import Comparison
from discover.learners.registry import learner_title
from discover.protocols.kinematics import in_words
from discover.report.comparison import tables
from discover.report.comparison.table_of_laws import law_rows
from discover.report.page import render
from discover.report.parts import Missing, attempt

Content = Mapping[str, Any]

_STANDING = {
    "explained": "",
    "unexplained": "None of these laws describes the data to the noise. They are the best "
    "descriptions in their class.",
    "no_signal": "The data hold no signal, so no law is reported.",
}
_CONDITION = {
    True: "The intervals hold if the law is in the library, with small instrument errors "
    "fitted jointly.",
    False: "The intervals hold for this law alone, which is not the likeliest.",
}
_NO_TERM = {
    "explained": "No term: the known part alone explains the data.",
    "unexplained": "No term.",
    "no_signal": "No term is reported: the data hold no signal.",
}


@dataclass(frozen=True)
class Part:
    """A table or a paragraph of the page.

    `content`: returns the template's variables; None where there is nothing to show.
    """

    title: str  # what it is, as the subject of a sentence
    template: str  # file in ``templates/comparison``, without its extension
    content: Callable[[], Content | None]

    def draw(self, comparison: Comparison, run: Content) -> str | Missing | None:
        """Return the part as HTML; None where there is nothing to show."""

        def drawn() -> str | None:
            content = self.content()
            if content is None:
                return None
            name = f"comparison/{self.template}.html"
            return Markup(render(name, comparison=comparison, run=run, **content))

        return attempt(self.title, drawn)


@dataclass(frozen=True)
class Section:
    """A heading with what stands below it.

    `anchor`, `heading`, `link`: identifier, heading, and the words of the link at the top; without
        words, no link.
    """

    anchor: str
    heading: str
    link: str
    parts: tuple[str | Missing, ...]  # HTML, or what could not be drawn


def sections(comparison: Comparison, run: Content, linear_relaxation: bool) -> list[Section]:
    """Return the sections between the pictures and how it was learned, without the empty ones."""
    drawn = []
    for anchor, heading, link, parts in _outline(comparison, linear_relaxation):
        if anchor == "law" and not comparison.outcomes:  # a simple material asks no learner
            continue
        shown = [part.draw(comparison, run) for part in parts]
        kept = tuple(part for part in shown if part is not None)
        if kept:
            drawn.append(Section(anchor, heading, link, kept))
    return drawn


def _outline(comparison: Comparison, linear_relaxation: bool):
    def laws() -> Content:
        outcomes = comparison.outcomes.values()
        drawn = [
            tables.law(outcome, linear_relaxation, comparison.known_part_of(outcome.learner))
            for outcome in outcomes
        ]
        return {"laws": drawn, "standing": _STANDING[comparison.verdict]}

    def terms() -> Content:
        interval = tables.network_interval(comparison)
        return {
            "columns": tables.learner_columns(comparison),
            "term_rows": tables.term_rows(comparison),
            "network_interval": interval,
            "condition": _CONDITION[comparison.determined_terms],
            "no_term": _NO_TERM[comparison.verdict],
        }

    def errors() -> Content:
        titles = ["before", *(learner_title(name) for name in comparison.outcomes)]
        flows = (*comparison.flows_of("training"), *comparison.judged)
        return {
            "columns": titles,
            "error_rows": tables.error_rows(comparison),
            "recorded": in_words(f.protocol.quantity for f in comparison.flows_of("training")),
            "others": in_words(q for f in flows if (q := f.protocol.quantity) != "sigma12"),
        }

    def classical() -> Content | None:
        rows = law_rows(comparison) if comparison.classical else []
        judged = [comparison.placement(flow).inside for flow in comparison.judged]
        return (
            {"law_rows": rows, "inside": True in judged, "beyond": False in judged}
            if rows
            else None
        )

    def explanations() -> Content | None:
        rows = tables.explanation_rows(comparison)
        left = comparison.posterior.explanations.unexplained_probability
        return {"explanations": rows, "none": left} if rows else None

    def held_out_by_run() -> Content | None:
        found = tables.selection(comparison)
        return {"selection": found} if found and found["runs"] else None

    def rivals() -> Content:
        spelled = tables.titles(comparison)
        rows = [tables.rival_row(rival, spelled) for rival in comparison.rivals]
        return {"rivals": rows}

    def physics() -> Content | None:
        rows = tables.physics_rows(comparison)
        titles = [learner_title(name) for name in comparison.physics]
        return {"physics_titles": titles, "physics_rows": rows} if rows else None

    return (
        (
            "errors",
            "Errors in test flows",
            "Errors",
            [Part("The table of errors", "errors", errors)],
        ),
        (
            "law",
            "Laws found",
            "Laws found",
            [
                Part("The laws found", "laws", laws),
                Part("The table of terms", "terms", terms),
                Part("The table of explanations", "explanations", explanations),
                Part(
                    "The table of the network's coefficients",
                    "coefficients",
                    lambda: _unless_empty("coefficients", tables.coefficients(comparison)),
                ),
            ],
        ),
        (
            "classical",
            "Against the classical laws",
            "Classical laws",
            [Part("The table of classical laws", "classical", classical)],
        ),
        (
            "selection-path",
            "Which law to believe",
            "Which law to believe",
            [
                Part(
                    "The path of laws",
                    "selection",
                    lambda: _unless_empty("selection", tables.selection(comparison)),
                ),
                Part("The misfits on runs left out", "held_out_by_run", held_out_by_run),
            ],
        ),
        (
            "open",
            "Not determined",
            "Not determined",
            [
                Part("What is not determined", "statements", dict),
                Part("The table of rivals", "rivals", rivals),
            ],
        ),
        (
            "next",
            "What to measure next",
            "What to measure next",
            [
                Part(
                    "The table of experiments",
                    "next",
                    lambda: _unless_empty("tests", tables.next_rows(comparison)),
                )
            ],
        ),
        (
            "distillation",
            "Distillation: what a simpler law learns from this one",
            "",
            [
                Part(
                    "The table of distillations",
                    "distillation",
                    lambda: _unless_empty("distillations", tables.distillations(comparison)),
                )
            ],
        ),
        (
            "structure",
            "What these flows could tell of any law in the library",
            "",
            [
                Part(
                    "What the flows could tell",
                    "structure",
                    lambda: _unless_empty("structure", tables.structure(comparison)),
                )
            ],
        ),
        (
            "physics",
            "Are the laws physically sound?",
            "Soundness",
            [Part("The checks of physical soundness", "physics", physics)],
        ),
    )


def _unless_empty(name: str, value: Any) -> Content | None:
    return {name: value} if value else None
