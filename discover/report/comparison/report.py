"""The report on a comparison: page, figures, JSON and LaTeX."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from markupsafe import Markup

from discover.comparison.comparison import Comparison
from discover.equations.markup import PREAMBLE, law_latex
from discover.learners.registry import learner_title
from discover.plain_numbers import json_text
from discover.report.comparison import tables
from discover.report.comparison.tables import learner_lines
from discover.report.first_screen import answer_screen
from discover.report.page import Missing, attempt, made_by, render, safe_name
from discover.report.plots.comparison import (
    error_map_picture,
    flow_picture,
    high_deborah_picture,
    start_up_picture,
    training_picture,
)
from discover.report.plots.style import Picture
from discover.report.predictions import PREDICTIONS, comparison_predictions, write_predictions
from discover.study.run_folder import RunFolder

Drawn = Picture | Missing


def comparison_pictures(comparison: Comparison) -> tuple[list[Drawn], list[Drawn]]:
    """Return the pictures of what was found, and those of training."""
    found: list[tuple[str, Callable[[], Picture | None]]] = []
    for flow in comparison.unseen_flows:
        draw = flow_picture if flow.oscillatory else start_up_picture
        found.append((f"The picture of {flow.title}", partial(draw, comparison, flow)))
    runs = ("The picture of the training runs", partial(training_picture, comparison))
    if not comparison.unseen_flows:  # what was fitted is then all that shows a law at work
        found.append(runs)
    found += [
        ("The map of errors", partial(error_map_picture, comparison)),
        ("The picture of high Deborah numbers", partial(high_deborah_picture, comparison)),
    ]
    return _drawn(found), _drawn([runs] if comparison.unseen_flows else [])


def _drawn(pictures: Sequence[tuple[str, Callable[[], Picture | None]]]) -> list[Drawn]:
    drawn = [attempt(title, draw) for title, draw in pictures]
    return [one for one in drawn if one is not None]


SECTIONS: Mapping[tuple[str, str, str], Mapping[str, str]] = {
    ("errors", "Errors in test flows", "Errors"): {"errors": "The table of errors"},
    ("law", "Laws found", "Laws found"): {
        "laws": "The laws found",
        "terms": "The table of terms",
        "explanations": "The table of explanations",
        "coefficients": "The table of the network's coefficients",
    },
    ("classical", "Against the classical laws", "Classical laws"): {
        "classical": "The table of classical laws"
    },
    ("open", "Not determined", "Not determined"): {
        "statements": "What is not determined",
        "rivals": "The table of rivals",
    },
    ("next", "What to measure next", "What to measure next"): {"next": "The table of experiments"},
    ("physics", "Are the laws physically sound?", "Soundness"): {
        "physics": "The checks of physical soundness"
    },
}
"""Anchor, heading and words of the link at the top (without words, no link) of each section; its
parts by file in ``templates/comparison``, with what they are as the subject of a sentence."""


def sections(comparison: Comparison, linear_relaxation: bool) -> list[dict[str, Any]]:
    """Return the sections between the pictures and how it was learned, without the empty ones.

    Each has its anchor, heading, link and parts: HTML, or what could not be drawn.
    """

    def draw(template: str) -> str | None:
        text = render(
            f"comparison/{template}.html", comparison=comparison, tables=tables,
            linear_relaxation=linear_relaxation,
        )  # fmt: skip
        return Markup(text) if text.strip() else None

    drawn = []
    for (anchor, heading, link), parts in SECTIONS.items():
        shown = [attempt(title, partial(draw, name)) for name, title in parts.items()]
        if kept := [part for part in shown if part is not None]:
            drawn.append({"anchor": anchor, "heading": heading, "link": link, "parts": kept})
    return drawn


def write_comparison(
    comparison: Comparison,
    folder: RunFolder,
    linear_relaxation: bool,
    study_text: str = "",
    run: dict | None = None,
) -> Path:
    """Write ``comparison.json``, ``predictions.csv``, ``equations.tex``, the figures and the page.

    Returns the page. The numbers come first: a picture or a table that cannot be drawn then costs
    its own place on the page and nothing else.

    `linear_relaxation`: whether −σ was part of the known law. `run`: what the page says of the run
    that made it, where that was no command.
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
        sections=sections(comparison, linear_relaxation),
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
