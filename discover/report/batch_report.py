"""The page over a batch of studies: what each found, side by side."""

import html
from collections.abc import Mapping, Sequence
from typing import Any

from discover.equations.spelling.markup import number, term_mathml
from discover.learners.registry import learner_title
from discover.report.page import render
from discover.words import FIGURE_SYMBOLS, effect_title

_COMPARED = ("sigma12", "N1", "N2")


def batch_page(studies: Sequence[Any], rows: Sequence[Any]) -> str:
    """Return the page over a batch.

    `studies`: how each study ended, `discover.batch.status.StudyStatus`. `rows`: what each found,
    `discover.batch.status.StudyRow`, in the same order.
    """
    learners = list(dict.fromkeys(name for row in rows for name in row.learners))
    pairs = list(zip(studies, rows, strict=True))
    return render(
        "batch.html",
        studies=studies,
        failed=[study for study in studies if study.status == "failed"],
        waiting=sum(study.status == "waiting" for study in studies),
        learners=[learner_title(name) for name in learners],
        symbols=[FIGURE_SYMBOLS[quantity] for quantity in _COMPARED],
        comparisons=[
            {
                "study": study,
                "verdict": row.verdict.replace("_", " "),
                "cells": _cells(row, learners),
                "row": row,
            }
            for study, row in pairs
            if row.learners
        ],
        loops=[
            {
                "study": study,
                "verdict": row.verdict.replace("_", " "),
                "effects": ", ".join(map(effect_title, row.effects)),
                "row": row,
            }
            for study, row in pairs
            if row.verdict and not row.learners
        ],
    )


def _cells(row: Any, learners: Sequence[str]) -> list[dict[str, Any]]:
    cells = []
    for name in learners:
        found = row.learners.get(name)
        terms: Sequence[tuple[str, float, Mapping[str, float]]] = (
            () if found is None else found.terms
        )
        errors: Mapping[str, float] = {} if found is None else found.errors
        cells.append(
            {
                "law": "–" if found is None else _law(terms),
                "size": len(terms),
                "errors": [errors.get(quantity) for quantity in _COMPARED],
            }
        )
    return cells


def _law(terms: Sequence[tuple[str, float, Mapping[str, float]]]) -> str:
    parts = []
    for i, (term, value, inner) in enumerate(terms):
        sign = "−" if value < 0 else "+" if i else ""
        if sign:
            sign = f"<mo form='{'infix' if i else 'prefix'}'>{sign}</mo>"
        parts.append(f"{sign}{_term(term, inner, abs(value))}")
    # each term stands alone, so that a long law goes on in the next line
    return "<wbr/>".join(f"<math><mrow>{part}</mrow></math>" for part in parts) or "no term"


def _term(name: str, inner: Mapping[str, float], coefficient: float) -> str:
    try:
        return term_mathml(name, inner, coefficient)
    except ValueError:  # a file that somebody edited
        return f"{number(coefficient)}<mtext>{html.escape(name[:200])}</mtext>"
