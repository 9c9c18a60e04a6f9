"""The report on a comparison: page, figures, JSON and LaTeX."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from discover.comparison.comparison import Comparison
from discover.comparison.outcome import LearnerOutcome
from discover.equations.spelling.markup import PREAMBLE, law_latex
from discover.learners.registry import learner_title
from discover.plain_numbers import json_text
from discover.protocols.kinematics import in_words
from discover.report.comparison import tables
from discover.report.comparison.tables import learner_lines
from discover.report.page import Missing, answer_screen, attempt, made_by, render, safe_name
from discover.report.plots.comparison.flows import flow_picture, start_up_picture, training_picture
from discover.report.plots.comparison.selection import (
    error_map_picture,
    high_deborah_picture,
    selection_picture,
)
from discover.report.plots.style import Picture
from discover.report.predictions import PREDICTIONS, comparison_predictions, write_predictions
from discover.study.run_folder import RunFolder
from discover.words import estimate, interval, readable

Drawn = Picture | Missing


def comparison_pictures(comparison: Comparison) -> tuple[list[Drawn], list[Drawn]]:
    """Return the pictures of what was found, and those of training."""
    sparse = comparison.outcomes.get("tensor_sindy")
    details = {} if sparse is None else sparse.details
    found: list[tuple[str, Callable[[], Picture | None]]] = []
    for flow in comparison.judged:
        draw = flow_picture if flow.oscillatory else start_up_picture
        found.append((f"The picture of {flow.title}", partial(draw, comparison, flow)))
    runs = ("The picture of the training runs", partial(training_picture, comparison))
    if not comparison.judged:  # what was fitted is then all that shows a law at work
        found.append(runs)
    found += [
        ("The map of errors", partial(error_map_picture, comparison)),
        ("The picture of the selection", partial(selection_picture, details)),
        ("The picture of high Deborah numbers", partial(high_deborah_picture, comparison)),
    ]
    return _drawn(found), _drawn([runs] if comparison.judged else [])


def _drawn(pictures: Sequence[tuple[str, Callable[[], Picture | None]]]) -> list[Drawn]:
    drawn = [attempt(title, draw) for title, draw in pictures]
    return [one for one in drawn if one is not None]


def law_rows(comparison: Comparison) -> list[dict[str, Any]]:
    """Return every law fitted to the runs, classical and learned: constants, misfit, errors.

    Errors are means, of the recorded stress, over the flows that no fit saw, those inside the
    fitted range apart from those beyond it.
    """
    placed = {flow.name: comparison.placement(flow).inside for flow in comparison.judged}
    rows = [
        {
            "law": fit.title,
            "constants": ", ".join(
                f"{readable(name)} = {estimate(value, fit.ci95[name])} ({interval(fit.ci95[name])})"
                for name, value in fit.parameters.items()
            ),
            "number": len(fit.parameters),
            "misfit": fit.misfit,
            "criterion": fit.criterion,
            **_mean_errors(fit.errors, placed),
        }
        for fit in comparison.classical
    ]
    for name, outcome in comparison.outcomes.items():
        errors = {flow.name: comparison.errors(name, flow) for flow in comparison.judged}
        left = comparison.lack_of_fit.get(name)
        rows.append(
            {
                "law": learner_title(name),
                "constants": "",
                "number": _number_of_constants(outcome),
                "misfit": None if left is None else left.misfit,
                "criterion": None,
                **_mean_errors(errors, placed),
            }
        )
    return rows


def _number_of_constants(outcome: LearnerOutcome) -> int | None:
    """Return how many numbers of a law were fitted; None of a learner that does not say."""
    if outcome.learner == "tensor_sindy":
        return sum(1 + len(term.inner) for term in outcome.terms)
    return outcome.details.get("n_constants")


def _mean_errors(
    errors: Mapping[str, Mapping[str, float | None]], inside: Mapping[str, bool]
) -> dict[str, float | None]:
    """Return the mean error of the recorded stress inside the fitted range and beyond it."""
    means: dict[str, float | None] = {}
    for name, wanted in (("inside", True), ("beyond", False)):
        flows = [flow for flow, is_inside in inside.items() if is_inside is wanted]
        # what is recorded comes first
        values = [next(iter(errors[flow].values())) for flow in flows]
        said = [value for value in values if value is not None]
        # a law that cannot be integrated through one of the flows has no mean
        means[name] = float(np.mean(said)) if said and len(said) == len(values) else None
    return means


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


Part = tuple[str, str, Callable[[], Content | None]]
"""What it is, as the subject of a sentence; file in ``templates/comparison``, without extension;
what returns the template's variables, or None where there is nothing to show."""


@dataclass(frozen=True)
class Section:
    """A heading with what stands below it."""

    anchor: str
    heading: str
    link: str  # words of the link at the top; without words, no link
    parts: tuple[str | Missing, ...]  # HTML, or what could not be drawn


def sections(comparison: Comparison, run: Content, linear_relaxation: bool) -> list[Section]:
    """Return the sections between the pictures and how it was learned, without the empty ones."""

    def draw(template: str, make: Callable[[], Content | None]) -> str | None:
        content = make()
        name = f"comparison/{template}.html"
        if content is None:
            return None
        return Markup(render(name, comparison=comparison, run=run, **content))

    drawn = []
    for (anchor, heading, link), parts in _outline(comparison, linear_relaxation).items():
        if anchor == "law" and not comparison.outcomes:  # a simple material asks no learner
            continue
        shown = [attempt(title, partial(draw, name, make)) for title, name, make in parts]
        kept = tuple(part for part in shown if part is not None)
        if kept:
            drawn.append(Section(anchor, heading, link, kept))
    return drawn


def _outline(
    comparison: Comparison, linear_relaxation: bool
) -> dict[tuple[str, str, str], list[Part]]:
    """Return the parts of each section, by its anchor, heading and link."""

    def table(name: str, rows: Callable[[Comparison], Any]) -> Callable[[], Content | None]:
        return lambda: {name: found} if (found := rows(comparison)) else None

    def laws() -> Content:
        outcomes = comparison.outcomes.values()
        drawn = [
            tables.law(outcome, linear_relaxation, comparison.known_or_maxwell)
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

    return {
        ("errors", "Errors in test flows", "Errors"): [("The table of errors", "errors", errors)],
        ("law", "Laws found", "Laws found"): [
            ("The laws found", "laws", laws),
            ("The table of terms", "terms", terms),
            ("The table of explanations", "explanations", explanations),
            (
                "The table of the network's coefficients",
                "coefficients",
                table("coefficients", tables.coefficients),
            ),
        ],
        ("classical", "Against the classical laws", "Classical laws"): [
            ("The table of classical laws", "classical", classical)
        ],
        ("selection-path", "Which law to believe", "Which law to believe"): [
            ("The path of laws", "selection", table("selection", tables.selection)),
            ("The misfits on runs left out", "held_out_by_run", held_out_by_run),
        ],
        ("open", "Not determined", "Not determined"): [
            ("What is not determined", "statements", dict),
            ("The table of rivals", "rivals", rivals),
        ],
        ("next", "What to measure next", "What to measure next"): [
            ("The table of experiments", "next", table("tests", tables.next_rows))
        ],
        ("structure", "What these flows could tell of any law in the library", ""): [
            ("What the flows could tell", "structure", table("structure", tables.structure))
        ],
        ("physics", "Are the laws physically sound?", "Soundness"): [
            ("The checks of physical soundness", "physics", physics)
        ],
    }


def write_comparison(
    comparison: Comparison,
    folder: RunFolder,
    linear_relaxation: bool,
    study_text: str = "",
    run: dict | None = None,
) -> Path:
    """Write ``comparison.json``, ``predictions.csv``, ``equations.tex``, the figures and the page.

    The numbers come first. A picture or a table that cannot be drawn then costs its own place on
    the page and nothing else.

    `linear_relaxation`: whether −σ was part of the known law. `study_text`: the study file, shown
    at the end. `run`: what the page says of the run that made it, where that was no command.

    Returns the page.
    """
    content = json_text(comparison.to_json())
    folder.write("comparison.json", content)
    predictions = write_predictions(comparison_predictions(comparison), folder)
    folder.write("equations.tex", equations_tex(comparison, linear_relaxation))
    pictures, training = comparison_pictures(comparison)
    for drawn in (*pictures, *training):
        if isinstance(drawn, Picture):
            folder.write(f"figures/{safe_name(drawn.name)}.svg", drawn.svg)
    run = run or made_by(
        folder.fingerprint,
        f"discover compare {comparison.name}.toml --seed {comparison.seed}",
        ("comparison.json", "predictions.csv", "equations.tex", "figures/*.svg"),
        study_text,
    )
    lines = attempt("What the learners found", lambda: learner_lines(comparison))
    page = render(
        "comparison.html",
        data={PREDICTIONS: predictions, "comparison.json": content},
        comparison=comparison,
        screen=answer_screen(comparison.answer),
        learners=lines,
        pictures=pictures,
        sections=sections(comparison, run, linear_relaxation),
        training_pictures=training,
        run=run,
    )
    return folder.write("report.html", page)


def equations_tex(comparison: Comparison, linear_relaxation: bool) -> str:
    """Return ``equations.tex``: the law that each learner found, with the known part below it."""
    parts = [PREAMBLE]
    for name, outcome in comparison.outcomes.items():
        known = comparison.known_or_maxwell
        terms = (*known.terms, *outcome.terms)
        named, note = known.named, ""
        if named is not None and not named.is_written:
            named, note = None, f", without the h of the known law {named.law}"
        equation = law_latex(terms, linear_relaxation, named=named)
        head = f"% {learner_title(name)}{note}\n"
        parts.append(f"{head}\\begin{{equation}}\n  {equation}\n\\end{{equation}}\n")
    return "\n".join(parts)
