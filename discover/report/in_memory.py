"""Results that a program holds: the report as the text of one page, and every run in one figure."""

import hashlib
import json
from contextlib import AbstractContextManager, suppress
from functools import singledispatch
from io import BytesIO
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from discover.comparison.comparison import Comparison
from discover.equations import write_equation
from discover.errors import InputError
from discover.fitting import NamedLawFit
from discover.learners.run_prediction import RunPrediction
from discover.loop.loop_result import LoopResult
from discover.loop.runs import record_runs
from discover.plain_numbers import json_text
from discover.report.comparison.report import write_comparison
from discover.report.first_screen import answer_screen
from discover.report.loop import write_loop
from discover.report.page import made_by, render
from discover.report.plots.comparison import drawn_records
from discover.report.plots.loop.runs import FITTED_LAW, drawn_runs
from discover.report.plots.style import Picture, picture
from discover.study.run_folder import RunFolder

_PAGE = "report.html"


class _PageAlone(RunFolder):
    """Takes what a report writes and keeps the page; there is no folder."""

    def __init__(self, result: Comparison | LoopResult):
        text = json.dumps(result.to_json(), sort_keys=True, default=str)
        self.fingerprint = hashlib.sha256(text.encode()).hexdigest()[:16]
        self.page = ""

    def write(self, name: str, text: str) -> Path:
        if name == _PAGE:
            self.page = text
        return Path(name)


def comparison_page(comparison: Comparison) -> str:
    """Return the report on a comparison as one page."""
    kept = _PageAlone(comparison)
    relaxes = comparison.known is None or comparison.known.linear_relaxation
    run = made_by(kept.fingerprint, "discover.compare(...) in Python", (), "")
    write_comparison(comparison, kept, relaxes, run=run)
    return kept.page


def loop_page(result: LoopResult) -> str:
    """Return the report on a closed loop as one page."""
    kept = _PageAlone(result)
    run = made_by(kept.fingerprint, "discover.close_loop(...) in Python", (), "")
    write_loop(result, kept, result.title or "closed loop", result.described, run=run)
    return kept.page


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


Drawn = AbstractContextManager[Figure]
"""A figure while the style of the pages holds."""


@singledispatch
def drawn(result: Any) -> Drawn:
    """Return the runs of a result with what it predicts of each; InputError if it holds none."""
    raise TypeError(type(result).__name__)


@drawn.register
def _(result: NamedLawFit) -> Drawn:
    return drawn_runs(_some(result.records), FITTED_LAW)


@drawn.register
def _(result: LoopResult) -> Drawn:
    return drawn_runs(_some(result.records))


@drawn.register
def _(result: RunPrediction) -> Drawn:
    if not hasattr(result, "runs_"):
        raise InputError(
            f"There is no run to draw: {type(result).__name__} is not fitted, or comes from a "
            "file, which holds no data. Fit it, or draw what predict(data) returns."
        )
    runs = list(result.runs_)
    pairs = zip(runs, result._predict_runs(runs), strict=True)
    records = [record_runs([run], values[None, None], False)[0] for run, values in pairs]
    return drawn_runs(_some(records), FITTED_LAW)


@drawn.register
def _(result: Comparison) -> Drawn:
    flows = [
        flow
        for flow in result.flows
        if flow.is_record and (flow.measured is not None or "sigma12" in flow.reference)
    ]
    return drawn_records(result, _some(flows))


def _some(runs: Any) -> Any:
    if not runs:
        raise InputError("There is no run to draw: the result holds no record. Give one with data.")
    return runs


def curves_figure(result: Any) -> Figure:
    """Return every run of a result as a figure of matplotlib, for a notebook.

    Raises InputError if the result holds no run.
    """
    with drawn(result) as drawing:
        # drawn here, where the style of the pages holds
        drawing.savefig(BytesIO(), format="svg")
        return drawing
