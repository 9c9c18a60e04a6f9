"""Pages on data: what was read, linear tests side by side, shifted curves."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from discover.dataset.checking.runs import Finding
from discover.dataset.dataset import Dataset
from discover.dataset.linear.superposition import FAILED, SUPERPOSED, ShiftLaw, Superposition
from discover.dataset.linear_viscoelasticity import relaxation_spectrum
from discover.dataset.material_functions import linear_sweep_as_run
from discover.dataset.run import Run
from discover.dataset.run_table import material_and_temperature, run_line
from discover.dataset.tables.table import toml_string
from discover.errors import InputError
from discover.report.page import attempt, render
from discover.report.plots.data import data_pictures, linear_function, superposition_pictures
from discover.report.wording import percent
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
        "beside": ", ".join(run.beside) or "–",
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


_DESCRIBES = 0.1
"""Decades of a_T, root mean square, by which a law may miss the shifts and still describe them."""

_UNKNOWN = 0.3
"""Standard error in decades from which on a shift factor is said not to be determined: 95 % would
span a factor of four either way."""

_SYMBOLS = {"C1": ("C1", ""), "C2_K": ("C2", "K"), "activation_energy_J_mol": ("E", "J/mol")}


def superposition_words(found: Superposition) -> list[str]:
    """Return what can be said of a superposition, a sentence each."""
    said = [_verdict(found)]
    if found.verdict == "not_superposed":
        return said
    open_ = [
        f"{found.celsius[i]:g}" for i in np.flatnonzero(np.max(found.error, axis=1) > _UNKNOWN)
    ]
    if open_:
        said.append(
            f"At {', '.join(open_)} °C these data do not determine the shift factors: where the "
            "curves overlap they are straight lines, which slide along themselves."
        )
    return [*said, *(_law_words(law, found) for law in found.laws)]


def _verdict(found: Superposition) -> str:
    if not found.misfits:  # shifts that nothing determines may leave no overlap
        return (
            "Whether the sweeps superpose is doubtful: moved by the shifts found, those of "
            "neighbouring temperatures do not overlap."
        )
    (cold, warm), size = max(found.misfits.items(), key=lambda item: item[1])
    worst, where = percent(size), f"{cold:g} and {warm:g} °C"
    if found.verdict == "superposed":
        return f"The sweeps superpose: the worst overlap, of {where}, is off by {worst}."
    if found.verdict == "doubtful":
        return (
            f"Whether the sweeps superpose is doubtful: those at {where} are off by {worst} where "
            f"they overlap, more than two loadings of one sample usually are "
            f"({percent(SUPERPOSED)})."
        )
    return (
        f"The sweeps do not superpose: those at {where} are off by {worst} where they overlap "
        f"({percent(FAILED)} or more). No single sweep stands for them; leave temperatures out "
        "with --between, or allow a shift of the moduli with --vertical."
    )


def _law_words(law: ShiftLaw, found: Superposition) -> str:
    if law.error > _DESCRIBES:
        return (
            f"{law.name} does not describe the shifts: off by {law.error:.2g} decades (root mean "
            "square)."
        )
    parts = []
    for key, value in law.values.items():
        symbol, unit = _SYMBOLS[key]
        interval = law.intervals[key]
        known = (
            "not determined by these shifts"
            if interval is None
            else f"95 % CI {interval[0]:.4g} to {interval[1]:.4g}"
        )
        parts.append(f"{symbol} = {f'{value:.4g} {unit}'.strip()} ({known})")
    return (
        f"{law.name} at {found.reference:g} °C: {', '.join(parts)}; off by {law.error:.2g} "
        "decades (root mean square)."
    )


def superposition_page(found: Superposition, name: str) -> str:
    """Return the page."""
    pictures = attempt("The pictures", lambda: superposition_pictures(found))
    off = {cold: percent(misfit) for (cold, _), misfit in found.misfits.items()}
    return render(
        "superposition.html",
        name=name,
        words=superposition_words(found),
        doubtful=found.verdict != "superposed",
        pictures=pictures if isinstance(pictures, list) else [],
        missing=None if isinstance(pictures, list) else pictures.sentence,
        lines=[
            {
                "temperature": f"{degrees:g}",
                "a": _table_factor(found, i, 0),
                "b": _table_factor(found, i, 1),
                "misfit": off.get(degrees, ""),
            }
            for i, degrees in enumerate(found.celsius.tolist())
        ],
    )


def _table_factor(found: Superposition, at: int, which: int) -> str:
    value, low, high = found.factors(at)[which]
    if low == high:
        return f"{value:.4g}"
    if found.error[at, which] > _UNKNOWN:
        return "not determined"
    return f"{value:.4g} ({low:.4g} to {high:.4g})"
