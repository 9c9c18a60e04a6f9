"""Reports on results that a program holds, as the text of one page."""

import hashlib
import json
from contextlib import suppress
from pathlib import Path
from typing import Any

from discover.comparison.comparison import Comparison
from discover.equations import write_equation
from discover.errors import InputError
from discover.fitting import NamedLawFit
from discover.loop.loop_result import LoopResult
from discover.plain_numbers import json_text
from discover.report.comparison.report import write_comparison
from discover.report.curves import drawn
from discover.report.loop.report import write_loop
from discover.report.page import answer_screen, made_by, render
from discover.report.plots.style import Picture, picture
from discover.study.run_folder import RunFolder

_PAGE = "report.html"


class _PageAlone(RunFolder):
    """Takes what a report writes and keeps the page; there is no folder."""

    def __init__(self, fingerprint: str):
        self.fingerprint = fingerprint
        self.page = ""

    def write(self, name: str, text: str) -> Path:
        if name == _PAGE:
            self.page = text
        return Path(name)


def comparison_page(comparison: Comparison) -> str:
    """Return the report on a comparison as one page."""
    kept = _PageAlone(_fingerprint(comparison.to_json()))
    relaxes = comparison.known is None or comparison.known.linear_relaxation
    run = made_by(kept.fingerprint, "discover.compare(...) in Python", (), "")
    write_comparison(comparison, kept, relaxes, run=run)
    return kept.page


def loop_page(result: LoopResult) -> str:
    """Return the report on a closed loop as one page."""
    kept = _PageAlone(_fingerprint(result.to_json()))
    run = made_by(kept.fingerprint, "discover.close_loop(...) in Python", (), "")
    write_loop(result, kept, result.title or "closed loop", result.described, run=run)
    return kept.page


def _fingerprint(content: dict[str, Any]) -> str:
    text = json.dumps(content, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def fit_page(fit: NamedLawFit) -> str:
    """Return the page on a fit: its answer, every run drawn, standard errors, correlation."""
    return render(
        "fit.html",
        name=fit.title or fit.law,
        screen=answer_screen(fit.answer),
        summary=fit.summary() if fit.constants else None,
        correlation=fit.correlation,
        picture=fit_picture(fit),
    )


def fit_picture(fit: NamedLawFit) -> Picture:
    """Return every run, measured and by the fitted law."""
    with drawn(fit) as drawing:
        caption = "Every run, measured and by the fitted law, with its relative error."
        if any(record.held_out for record in fit.records):
            caption += " Runs in orange were held out."
        return picture(drawing, "runs", caption)


def fit_files(fit: NamedLawFit) -> dict[str, str]:
    """Return what a fit writes besides its page, text by name of file."""
    files = {"fit.json": json_text(fit.to_json()), "figures/runs.svg": fit_picture(fit).svg}
    with suppress(InputError):  # the page and fit.json hold its constants all the same
        files["equations.tex"] = write_equation(fit.equation(), "latex", None, None)
    return files
