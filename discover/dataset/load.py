"""Load a folder of measured runs: ``runs.csv``, one CSV a run, optionally ``lve.csv``."""

import os
from pathlib import Path

import numpy as np
from jaxtyping import Float

from discover.dataset import units
from discover.dataset.differentiation import DEFAULT_WINDOW, differentiate
from discover.dataset.run import LinearSweep, ShearDataset, ShearRun
from discover.dataset.table import Table, read_table
from discover.errors import InputError
from discover.protocols.shear import ShearProtocol, measured_rate, start_up

DATA_VARIABLE = "DISCOVER_DATA"
"""Environment variable that names the folder of data folders."""

INDEX_FILE = "runs.csv"
SWEEP_FILE = "lve.csv"

# A rate column is a command, repeated, if it varies no more than rounding to text does
_CONSTANT = 1e-6


def resolve_folder(folder: str | Path, base: str | Path | None = None) -> Path:
    """Return the path of a data folder.

    Parameters
    ----------
    folder
        Path of the folder. A relative one is looked for beside the study file, then in the
        folder named by the environment variable DISCOVER_DATA, then in the working directory.
    base
        Folder of the study file, if there is one.

    Raises
    ------
    InputError
        If there is no such folder, or it has no ``runs.csv``.
    """
    path = Path(folder).expanduser()
    data = os.environ.get(DATA_VARIABLE)
    roots = [Path(root) for root in (base, data, ".") if root]
    candidates = [path] if path.is_absolute() else [root / path for root in roots]
    for candidate in candidates:
        if (candidate / INDEX_FILE).is_file():
            return candidate
    for candidate in candidates:
        if candidate.is_dir():
            raise InputError(
                f"The folder {str(folder)!r} has no {INDEX_FILE}. A data folder needs one, with a "
                "column 'file' and one line a run."
            )
    hint = "" if data else f" The environment variable {DATA_VARIABLE} is not set."
    raise InputError(
        f"There is no data folder {str(folder)!r}. Give its path, absolute or relative to the "
        f"study file or to {DATA_VARIABLE}.{hint}"
    )


def load_dataset(
    folder: str | Path,
    clock_factor: str | None = None,
    base: str | Path | None = None,
    rate_is_measured: bool = False,
    rate_window: int = DEFAULT_WINDOW,
) -> ShearDataset:
    """Return the runs of a folder, and its linear sweep if it has one, in SI units.

    A column may carry another unit in its name, such as ``stress_kPa`` or ``time_ms``. A run
    without a shear rate must have the strain; its rate is then derived from it, and its metadata
    say so under ``shear_rate_source``.

    Parameters
    ----------
    folder, base
        As in `resolve_folder`.
    clock_factor
        Column of ``runs.csv`` with instrument time = time / factor, if any.
    rate_is_measured
        Whether a shear rate that stays constant was measured all the same. A rate that varies is
        always followed sample by sample.
    rate_window
        Samples in the moving window when the rate is derived from strain.

    Raises
    ------
    InputError
        If something in the folder is wrong; the message says what, where and how to mend it.
    """
    root = resolve_folder(folder, base)
    index = read_index(root)
    factors = read_clock_factors(index, clock_factor)
    runs = tuple(
        read_run(root, index, row, factors[row], rate_is_measured, rate_window)
        for row in range(len(index))
    )
    provenance = root / "PROVENANCE.md"
    return ShearDataset(
        name=root.resolve().name,
        runs=runs,
        linear_sweep=read_sweep(root / SWEEP_FILE) if (root / SWEEP_FILE).exists() else None,
        provenance=provenance.read_text("utf-8", "replace") if provenance.is_file() else "",
    )


def read_index(root: Path) -> Table:
    """Return ``runs.csv``, checked for its column ``file``.

    Raises
    ------
    InputError
        If the column is missing, or a name in it is empty, repeated or outside the folder.
    """
    index = read_table(root / INDEX_FILE)
    if "file" not in index.columns:
        raise InputError(
            f"{INDEX_FILE} has no column 'file'; its columns are {', '.join(index.columns)}. Add "
            "it, with the file name of each run."
        )
    names = [name.strip() for name in index.columns["file"]]
    inside = root.resolve()
    for row, name in enumerate(names):
        if not name:
            raise InputError(f"Line {row + 2} of {INDEX_FILE} names no file.")
        if names.count(name) > 1:
            raise InputError(f"{INDEX_FILE} names {name} twice; keep one line.")
        if "\0" in name or not (root / name).resolve().is_relative_to(inside):
            raise InputError(
                f"{INDEX_FILE} names {name!r}, which lies outside the folder. Put the file in the "
                "folder and name it without a path."
            )
    return index


def read_clock_factors(index: Table, column: str | None) -> Float[np.ndarray, " runs"]:
    """Return the clock factor of every run; ones if no column is named.

    Raises
    ------
    InputError
        If the column is missing or holds something other than positive numbers.
    """
    if column is None:
        return np.ones(len(index))
    if column not in index.columns:
        raise InputError(
            f"clock_factor names the column {column!r}, but {INDEX_FILE} has only "
            f"{', '.join(index.columns)}."
        )
    factors = index.numbers(column)
    if np.any(factors <= 0):
        row = int(np.argmax(factors <= 0))
        raise InputError(
            f"{column} in {INDEX_FILE} must be positive; line {row + 2} holds {factors[row]:g}."
        )
    return factors


def read_run(
    root: Path,
    index: Table,
    row: int,
    clock_factor: float = 1.0,
    rate_is_measured: bool = False,
    rate_window: int = DEFAULT_WINDOW,
) -> ShearRun:
    """Return the run on one line of ``runs.csv``.

    Raises
    ------
    InputError
        If its file is missing or wrong.
    """
    name = index.columns["file"][row].strip()
    table = read_table(root / name, name)
    time = table.required(units.TIME)
    if time[0] < 0:
        raise InputError(
            f"time in {name} must start at or after 0, when the flow starts; line 2 holds "
            f"{time[0]:g} s. Remove what came before the flow."
        )
    backwards = np.flatnonzero(np.diff(time) <= 0)
    if backwards.size:
        line = int(backwards[0]) + 3
        raise InputError(
            f"time in {name} must increase strictly; line {line} holds {time[line - 2]:g} s after "
            f"{time[line - 3]:g} s. Sort the rows and remove repeated times."
        )
    metadata = _metadata(index, row)
    strain = table.quantity(units.STRAIN)
    rate = table.quantity(units.SHEAR_RATE)
    if rate is None:
        if strain is None:
            # said in the words of the commoner mistake
            strain = table.required(units.SHEAR_RATE)
        try:
            rate = differentiate(time, strain, rate_window)
        except InputError as error:
            raise InputError(f"{name}: {error}") from error
        source = f"derived from strain: moving cubic over {min(rate_window, len(time))} samples"
        protocol = measured_rate(time, rate)
    else:
        protocol, source = _protocol(time, rate, rate_is_measured)
    metadata["shear_rate_source"] = source
    return ShearRun(
        name=name,
        time=time,
        protocol=protocol,
        shear_rate=rate,
        shear_stress=table.required(units.SHEAR_STRESS),
        first_normal_stress_difference=table.quantity(units.FIRST_NORMAL_STRESS_DIFFERENCE),
        second_normal_stress_difference=table.quantity(units.SECOND_NORMAL_STRESS_DIFFERENCE),
        strain=strain,
        clock_factor=float(clock_factor),
        metadata=metadata,
    )


def _protocol(
    time: np.ndarray, rate: np.ndarray, rate_is_measured: bool
) -> tuple[ShearProtocol, str]:
    level = float(np.median(rate))
    if np.ptp(rate) <= _CONSTANT * abs(level):
        return start_up(level), "measured, constant" if rate_is_measured else "commanded, constant"
    return measured_rate(time, rate), "read sample by sample, linear between samples"


def _metadata(index: Table, row: int) -> dict[str, float | str]:
    metadata: dict[str, float | str] = {}
    for column, cells in index.columns.items():
        if column == "file":
            continue
        try:
            metadata[column] = float(cells[row])
        except ValueError:
            metadata[column] = cells[row]
    return metadata


def read_sweep(path: Path) -> LinearSweep:
    """Return a linear frequency sweep, sorted by frequency.

    Raises
    ------
    InputError
        If the file is wrong, or a frequency or modulus is not positive.
    """
    table = read_table(path)
    frequency = table.required(units.ANGULAR_FREQUENCY)
    storage = table.required(units.STORAGE_MODULUS)
    loss = table.required(units.LOSS_MODULUS)
    for label, values in (("omega", frequency), ("G'", storage), ("G''", loss)):
        if np.any(values <= 0):
            row = int(np.argmax(values <= 0))
            raise InputError(
                f"{label} in {table.name} must be positive; line {row + 2} holds {values[row]:g}. "
                "Remove that line."
            )
    order = np.argsort(frequency, kind="stable")
    return LinearSweep(frequency[order], storage[order], loss[order])
