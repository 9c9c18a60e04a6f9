"""The page and the figure of one named law fitted to runs."""

from contextlib import suppress
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np

from discover.equations import write_equation
from discover.errors import InputError
from discover.fitting import NamedLawFit
from discover.report.page import render
from discover.report.plots.loop.runs import (
    FIT_COLOUR,
    HELD_COLOUR,
    axis_label,
    short_title,
    through_decades,
)
from discover.report.plots.style import (
    TRUTH,
    Picture,
    label_rows,
    legend_above,
    make_logarithmic,
    panels_of,
    picture,
)
from discover.report.wording import significant

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def fit_page(fit: NamedLawFit) -> str:
    """Return the page on a fit: the law, its constants, their correlation, every run drawn."""
    ends = fit.conf_int()
    rows = [
        (
            one.name,
            significant(one.value, 4),
            f"{significant(low, 4)} to {significant(high, 4)}",
            significant(one.standard_error, 2),
            one.unit,
        )
        for one, (low, high) in zip(fit.constants, ends.to_numpy(), strict=True)
    ]
    modes = [
        (significant(mode["modulus_Pa"], 4), significant(mode["relaxation_time_s"], 4))
        for mode in fit.use["modes"]
    ]
    return render(
        "fit.html",
        name=fit.title or fit.law,
        fit=fit,
        law=_law_element(fit),
        rows=rows,
        modes=modes,
        correlation=fit.correlation.round(3),
        picture=fit_picture(fit),
    )


def _law_element(fit: NamedLawFit) -> str:
    try:
        equation = fit.equation()
    except InputError:
        return ""
    from discover.equations.spelling.mathml import law_element

    return law_element(equation.terms, equation.linear_relaxation, equation.named)


def _draw(fit: NamedLawFit, drawing, axes, panels) -> None:
    for panel, record in zip(panels, fit.records, strict=True):
        label, along = record.along
        every = max(1, record.time.size // 60)
        panel.plot(
            along[::every], record.measured[::every], "o", ms=2.5, mfc="none", mew=0.7,
            color=TRUTH, label="measured",
        )  # fmt: skip
        panel.plot(
            along, record.predicted[0], lw=1.5,
            color=HELD_COLOUR if record.held_out else FIT_COLOUR,
            label="law, held out" if record.held_out else "law, fitted",
        )  # fmt: skip
        if not record.is_transient:
            panel.set_xscale("log")
            if np.all(record.measured > 0.0) and np.all(record.predicted[0] > 0.0):
                panel.set_yscale("log")
        elif through_decades(record):
            make_logarithmic(panel.xaxis)
        panel.set_xlabel(label)
        panel.set_title(short_title(record), fontsize=8)
    label_rows(axes, [axis_label([record]) for record in fit.records])
    legend_above(drawing, axes)


def fit_picture(fit: NamedLawFit) -> Picture:
    """Return every run, measured and by the fitted law."""
    with panels_of(len(fit.records), width=10.0, height=2.2) as (drawing, axes, panels):
        _draw(fit, drawing, axes, panels)
        caption = "Every run, measured and by the fitted law, with its relative error."
        if any(record.held_out for record in fit.records):
            caption += " Runs in orange were held out."
        return picture(drawing, "runs", caption)


def fit_figure(fit: NamedLawFit) -> "Figure":
    """Return the same as a figure of matplotlib, for a notebook."""
    with panels_of(len(fit.records), width=10.0, height=2.2) as (drawing, axes, panels):
        _draw(fit, drawing, axes, panels)
        # drawn here, where the style of the pages holds
        drawing.savefig(BytesIO(), format="svg")
        return drawing


def fit_files(fit: NamedLawFit) -> dict[str, str]:
    """Return what a fit writes besides its page, text by name of file."""
    from discover.plain_json import json_text

    files = {"fit.json": json_text(fit.to_json()), "figures/runs.svg": fit_picture(fit).svg}
    with suppress(InputError):  # the page and fit.json hold its constants all the same
        files["equations.tex"] = write_equation(fit.equation(), "latex", None, None)
    return files
