"""The report on a comparison: page, figures, JSON and LaTeX."""

from collections.abc import Sequence
from pathlib import Path

from discover.comparison.comparison import Comparison
from discover.equations.spelling.markup import PREAMBLE, law_latex
from discover.learners.registry import learner_title
from discover.plain_json import json_text
from discover.report.answer_screen import answer_screen
from discover.report.comparison.learners import learner_lines
from discover.report.comparison.pictures import comparison_pictures
from discover.report.comparison.sections import sections
from discover.report.overlay import Overlay
from discover.report.page import made_by, render, safe_name
from discover.report.parts import attempt
from discover.report.plots.style import Picture
from discover.report.predictions import PREDICTIONS, comparison_predictions, write_predictions
from discover.study.run_folder import RunFolder


def write_comparison(
    comparison: Comparison,
    folder: RunFolder,
    linear_relaxation: bool,
    study_text: str = "",
    run: dict | None = None,
    overlays: Sequence[Overlay] = (),
) -> Path:
    """Write ``comparison.json``, ``predictions.csv``, ``equations.tex``, the figures and the page.

    The numbers come first. A picture or a table that cannot be drawn then costs its own place on
    the page and nothing else.

    `linear_relaxation`: whether −σ was part of the known law. `study_text`: the study file, shown
    at the end. `run`: what the page says of the run that made it, where that was no command.
    `overlays`: curves that the study asks for beside the learners'.

    Returns the page.
    """
    content = json_text(comparison.to_json())
    folder.write("comparison.json", content)
    predictions = write_predictions(comparison_predictions(comparison, overlays), folder)
    folder.write("equations.tex", equations_tex(comparison, linear_relaxation))
    pictures, training = comparison_pictures(comparison, overlays)
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
        known = comparison.known_part_of(name)
        terms = (*known.terms, *outcome.terms)
        named, beside = known.named, ""
        if named is not None and not named.is_written:
            named, beside = None, f", without the h of the known law {named.law}"
        equation = law_latex(terms, linear_relaxation, named=named)
        head = f"% {learner_title(name)}{beside}\n"
        parts.append(f"{head}\\begin{{equation}}\n  {equation}\n\\end{{equation}}\n")
    return "\n".join(parts)
