"""Data folders and study files, written by hand: text alone, none of the software under test."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from independent.instruments import Recording


def write_folder(
    folder: Path,
    runs: Mapping[str, Recording],
    metadata: Mapping[str, Mapping[str, Any]] | None = None,
    normal_stresses: bool = False,
    digits: int = 9,
) -> Path:
    """Write ``runs.csv`` and one CSV a run; return the folder.

    `folder`: where; made if need be. `runs`: by file name. `metadata`: columns of ``runs.csv`` by
    run; an empty cell where a run has none. `normal_stresses`: whether N1 and N2 are written, where
    a record has them. `digits`: significant digits.
    """
    columns = {}
    for name, run in runs.items():
        told = {"time_s": run.time, "shear_rate_1_s": run.rate, "stress_Pa": run.stress}
        told |= {"N1_Pa": run.N1, "N2_Pa": run.N2} if normal_stresses else {}
        columns[name] = {**told, "strain": run.strain}
    return write_runs(folder, columns, metadata or {}, digits)


def write_runs(
    folder: Path, columns: Mapping[str, Mapping[str, np.ndarray | None]],
    cells: Mapping[str, Mapping[str, Any]], digits: int = 9,
) -> Path:  # fmt: skip
    """Write ``runs.csv`` with its cells by run, and the columns of each run; return the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    keys = list(dict.fromkeys(key for told in cells.values() for key in told))
    lines = [",".join(["file", *keys])]
    for name, told in columns.items():
        write_table(folder / name, told, digits)
        lines.append(",".join([name, *(str(cells.get(name, {}).get(key, "")) for key in keys)]))
    (folder / "runs.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder


def write_table(path: Path, columns: Mapping[str, np.ndarray | None], digits: int = 9) -> None:
    """Write columns by name to a CSV; those that are None are left out."""
    there = {name: np.asarray(values) for name, values in columns.items() if values is not None}
    rows = zip(*there.values(), strict=True)
    text = [",".join(there), *(",".join(f"{x:.{digits}g}" for x in row) for row in rows)]
    path.write_text("\n".join(text) + "\n", encoding="utf-8")


def maxwell_sweep(
    moduli: np.ndarray, relaxation_times: np.ndarray, frequencies: np.ndarray
) -> dict[str, np.ndarray]:
    """Return the columns of ``lve.csv`` of a Maxwell spectrum, in closed form."""
    omega = np.asarray(frequencies, float)
    wt = omega[:, None] * np.asarray(relaxation_times)
    share = np.asarray(moduli) / (1 + wt**2)
    return {
        "omega_rad_s": omega,
        "Gp_Pa": np.sum(share * wt**2, axis=1),
        "Gpp_Pa": np.sum(share * wt, axis=1),
    }


def write_study(path: Path, sections: Mapping[str, Any]) -> Path:
    """Write a study file from its sections; return its path."""
    path.write_text(to_toml(sections), encoding="utf-8")
    return path


def to_toml(content: Mapping[str, Any]) -> str:
    """Return nested values as TOML, tables at the top as sections; what TOML lacks becomes text."""
    tables = {key: value for key, value in content.items() if isinstance(value, Mapping)}
    top = {key: value for key, value in content.items() if key not in tables}
    lines = [f"{_toml(key)} = {_toml(value)}" for key, value in top.items()]
    for name, table in tables.items():
        lines += [f"[{_toml(name)}]", *(f"{_toml(k)} = {_toml(v)}" for k, v in table.items())]
    return "\n".join(lines) + "\n"


def _toml(value: Any) -> str:
    match value:
        case bool() | int() | float():
            return repr(value).lower()
        case Mapping():
            return "{" + ", ".join(f"{_toml(k)} = {_toml(v)}" for k, v in value.items()) + "}"
        case list() | tuple():
            return "[" + ", ".join(map(_toml, value)) + "]"
    return json.dumps(str(value), ensure_ascii=False).replace("\x7f", "")
