"""The page and the figure of one named law fitted to runs."""

from contextlib import suppress

from discover.equations import write_equation
from discover.errors import InputError
from discover.fitting import NamedLawFit
from discover.report.curves import curves_of, draw_curves
from discover.report.page import render
from discover.report.plots.style import Picture, panels_of, picture
from discover.words import significant


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
    from discover.equations.spelling.markup import law_element

    return law_element(equation.terms, equation.linear_relaxation, equation.named)


def fit_picture(fit: NamedLawFit) -> Picture:
    """Return every run, measured and by the fitted law."""
    with panels_of(len(fit.records), width=10.0, height=2.2) as (drawing, axes, panels):
        draw_curves(curves_of(fit), drawing, axes, panels)
        caption = "Every run, measured and by the fitted law, with its relative error."
        if any(record.held_out for record in fit.records):
            caption += " Runs in orange were held out."
        return picture(drawing, "runs", caption)


def fit_files(fit: NamedLawFit) -> dict[str, str]:
    """Return what a fit writes besides its page, text by name of file."""
    from discover.plain_json import json_text

    files = {"fit.json": json_text(fit.to_json()), "figures/runs.svg": fit_picture(fit).svg}
    with suppress(InputError):  # the page and fit.json hold its constants all the same
        files["equations.tex"] = write_equation(fit.equation(), "latex", None, None)
    return files
