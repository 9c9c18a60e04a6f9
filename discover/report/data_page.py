"""The page on a data folder: what each file was taken for, and a study to start from."""

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from discover.dataset.checking.finding import Finding
from discover.dataset.conditions import material_and_temperature
from discover.dataset.dataset import Dataset
from discover.dataset.linear_viscoelasticity import relaxation_spectrum
from discover.dataset.material_functions import linear_sweep_as_run
from discover.dataset.run import Run
from discover.dataset.run_table import run_line
from discover.errors import InputError
from discover.report.page import render
from discover.report.parts import attempt
from discover.report.plots.data import data_pictures

# From so many runs on one can be spared to judge
_ENOUGH_TO_HOLD_OUT = 3


def data_page(dataset: Dataset, findings: Sequence[Finding], folder: str) -> str:
    """Return a page with every test drawn, what is doubtful, and a study to start from.

    Parameters
    ----------
    dataset
        The data.
    findings
        Of the check of its folder.
    folder
        As the study names it.
    """
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
        notes=[str(finding) for finding in findings if finding.severity == "note"],
        pictures=pictures if isinstance(pictures, list) else [],
        missing=None if isinstance(pictures, list) else pictures.sentence,
        lines=[_line(run) for run in (*dataset, *tables)],
        study=first_study(dataset, folder),
        modes=0 if spectrum is None else len(spectrum),
    )


def _line(run: Run) -> dict[str, Any]:
    stated = run.protocol.control in ("steady", "oscillation")
    if run.protocol.control == "oscillation":
        along = (run.angular_frequency, "rad/s")
        if run.strain is not None and np.ptp(run.strain) > 0.0:
            along = (run.strain, "strain")
        values = [*(record.recorded for record in run.records)]
    else:
        along = (run.rate, "1/s") if stated else (run.time, "s")
        values = [run.recorded]
    unit = "strain" if run.quantity == "strain" else "Pa"
    return {
        "name": run.name,
        "taken_for": run_line(run)["flow"],
        "samples": len(run),
        "along": (*_ends(along[0]), along[1]),
        "rate": None if run.protocol.control == "oscillation" else _ends(run.rate),
        "values": (*_ends(np.concatenate(values)), unit),
        "beside": ", ".join(run.beside),
    }


def _ends(values: np.ndarray) -> tuple[float, float]:
    return float(np.min(values)), float(np.max(values))


def first_study(dataset: Dataset, folder: str) -> str:
    """Return a study of these data that runs as it is, as TOML.

    Parameters
    ----------
    dataset
        The data.
    folder
        As the study names it.
    """
    lines = ["[data]", f"folder = {_quoted(folder)}"]
    if len(dataset) >= _ENOUGH_TO_HOLD_OUT:
        fastest = max(dataset, key=lambda run: float(np.max(np.abs(run.rate))))
        lines.append(f"held_out = [{_quoted(fastest.name)}]  # no fit sees it: it judges")
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


def _quoted(text: str) -> str:
    # a basic string of TOML escapes as JSON does, and DEL besides
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
