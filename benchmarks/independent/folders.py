"""Data folders and study files, written by hand: text alone, none of the software under test."""

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
    folder.mkdir(parents=True, exist_ok=True)
    metadata = metadata or {}
    extra = list(dict.fromkeys(key for line in metadata.values() for key in line))
    lines = [",".join(["file", *extra])]
    for name, run in runs.items():
        cells = [str(metadata.get(name, {}).get(key, "")) for key in extra]
        lines.append(",".join([name, *cells]))
        columns = {"time_s": run.time, "shear_rate_1_s": run.rate, "stress_Pa": run.stress}
        columns |= {"N1_Pa": run.N1, "N2_Pa": run.N2} if normal_stresses else {}
        write_table(folder / name, {**columns, "strain": run.strain}, digits)
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


def write_study(path: Path, sections: Mapping[str, Mapping[str, Any]]) -> Path:
    """Write a study file from its sections; return its path."""
    lines = []
    for section, entries in sections.items():
        lines.append(f"[{section}]")
        lines += [f"{key} = {toml(value)}" for key, value in entries.items()]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def toml(value: Any) -> str:
    """Return a value as TOML spells it.

    Raises TypeError if TOML has no such value here.
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return f'"{escaped}"'
    if isinstance(value, int | float):
        return repr(float(value)) if isinstance(value, float) else str(value)
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml(item) for item in value) + "]"
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {toml(item)}" for key, item in value.items()) + " }"
    raise TypeError(f"No TOML for {type(value).__name__}.")
