"""The page on data: what was read, and linear tests side by side."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from discover.dataset import Dataset, Finding, Run, relaxation_spectrum
from discover.dataset.material_functions import linear_sweep_as_run
from discover.dataset.run_table import material_and_temperature, run_line
from discover.dataset.tables.table import toml_string
from discover.errors import InputError
from discover.report.page import attempt, render
from discover.report.plots.data import data_pictures, linear_function
from discover.words import counted, significant

# From so many runs on one can be spared as a test
_ENOUGH_TO_HOLD_OUT = 3


def data_page(
    dataset: Dataset, findings: Sequence[Finding], folder: str, imported: Sequence[str] = ()
) -> str:
    """Return a page with every test drawn, what is doubtful, and a study to start from."""
    try:
        spectrum = None
        if dataset.linear_sweep is not None:
            spectrum = relaxation_spectrum(dataset.linear_sweep)
    except (InputError, RuntimeError, np.linalg.LinAlgError):
        spectrum = None  # the check says why
    tables = list(dataset.material_functions.values())
    if dataset.linear_sweep is not None:
        tables.insert(0, linear_sweep_as_run(dataset.linear_sweep))
    pictures = attempt("The pictures", lambda: data_pictures(dataset, spectrum))
    return render(
        "data.html",
        name=dataset.name,
        conditions=material_and_temperature(dataset),
        doubts=[str(finding) for finding in findings if finding.severity != "note"],
        notes=[*imported, *(str(finding) for finding in findings if finding.severity == "note")],
        pictures=pictures if isinstance(pictures, list) else [],
        missing=None if isinstance(pictures, list) else pictures.sentence,
        lines=[*map(_line, dataset), *(_line(run, is_table=True) for run in tables)],
        study=first_study(dataset, folder),
        modes="" if spectrum is None else counted(len(spectrum), "mode"),
    )


def _line(run: Run, *, is_table: bool = False) -> dict[str, Any]:
    """Return what the page says of one file, with the values that it holds."""
    values, unit = run.recorded, "" if run.quantity == "strain" else "Pa"
    rate = _ends(run.rate, "1/s")
    along = _ends(run.time, "s")
    if run.protocol.control == "oscillation":
        values = np.concatenate([record.recorded for record in run.records])
        along, rate = _ends(run.angular_frequency, "rad/s"), "–"
        if run.strain is not None and np.ptp(run.strain) > 0.0:
            along = f"{_ends(run.strain, 'strain')}, {along}"
    elif run.protocol.control == "steady":
        along = "–"
    elif is_table:
        rate = "–"
        _, values, unit = linear_function(run)
    return {
        "name": run.name,
        "taken_for": run_line(run)["flow"],
        "samples": len(run),
        "along": along,
        "rate": rate,
        "recorded": _ends(values, unit),
        "beside": ", ".join(run.also_recorded) or "–",
    }


def _ends(values: np.ndarray, unit: str) -> str:
    low, high = (significant(float(end), 3) for end in (np.min(values), np.max(values)))
    return f"{low if low == high else f'{low} to {high}'} {unit}".strip()


def first_study(dataset: Dataset, folder: str) -> str:
    """Return a study of these data that runs as it is, as TOML."""
    lines = ["[data]", f"folder = {toml_string(folder)}"]
    if len(dataset) >= _ENOUGH_TO_HOLD_OUT:
        fastest = max(dataset, key=lambda run: float(np.max(np.abs(run.rate))))
        lines.append(
            f"held_out = [{toml_string(fastest.name)}]  # not fitted: it tests the law found"
        )
    for kind in dataset.material_functions:
        role = "judge" if len(dataset) else "fit"
        lines.append(f'{kind} = "{role}"  # or "{"fit" if role == "judge" else "judge"}"')
    if dataset.linear_sweep is not None and not len(dataset) and not dataset.material_functions:
        lines.append('lve = "fit"')
    lines += ["", "[model]", 'law = "ucm"  # the part of the law that is taken as known']
    if dataset.linear_sweep is not None:
        lines.append('modes = "lve"')
    else:
        lines += ['modulus_Pa = "fit"', 'relaxation_time_s = "fit"']
    lines += ["", "[loop]", "max_effects = 3"]
    return "\n".join(lines) + "\n"
