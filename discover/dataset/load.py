"""Load a folder of measured runs, ``runs.csv``, a CSV a run and tables; or tables in memory."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from inspect import signature
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd

from discover.dataset.dataset import Dataset
from discover.dataset.index_of_runs import rates_before, read_clock_factors, read_column, read_index
from discover.dataset.linear_viscoelasticity import LinearSweep
from discover.dataset.material_functions import TABLES, read_material_functions
from discover.dataset.read_run import INDEX_FILE, SetAside, read_run, table_of_run
from discover.dataset.records.repeats import in_sequence
from discover.dataset.run import Run
from discover.dataset.tables import units
from discover.dataset.tables.table import Table, did_you_mean_file, is_inside, read_bytes, table_in
from discover.errors import InputError, Problems
from discover.plain_numbers import as_number, short
from discover.words import unknown_name

DATA_VARIABLE = "DISCOVER_DATA"  # environment variable that names the folder of data folders
SWEEP_FILE = "lve.csv"
PROVENANCE_FILE = "PROVENANCE.md"
# lists tables of one kind at several temperatures, of which no fit takes more than one
TESTS_FILE = "tests.csv"
# files of which a folder needs one to be a data set
DATA_FILES = (INDEX_FILE, SWEEP_FILE, *(f"{kind}.csv" for kind in TABLES))


def resolve_folder(folder: str | Path, base: str | Path | None) -> Path:
    """Return the path of a data folder; InputError if there is none, or no data file in it.

    A relative one is looked for beside the study file, which is in `base`, then in the folder named
    by the environment variable DISCOVER_DATA, then in the working directory.
    """
    if not isinstance(folder, str | os.PathLike):
        raise InputError(
            f"A data folder is named by its path; got a {type(folder).__name__}. For tables in "
            "memory there is from_dataframe."
        )
    said = repr(str(folder))
    try:
        path = Path(folder).expanduser()
    except RuntimeError:
        raise InputError(f"{said} names a user who is not known here.") from None
    roots = [root for root in (base, os.environ.get(DATA_VARIABLE), ".") if root]
    candidates = [path] if path.is_absolute() else [Path(root) / path for root in roots]
    # os.path answers False where Path raises: no permission, names too long, zero bytes
    for candidate in candidates:
        if any(os.path.isfile(candidate / name) for name in DATA_FILES):
            return candidate
    there = [one for one in candidates if os.path.isdir(one) or os.path.isfile(one)]
    if not there:
        known = os.environ.get(DATA_VARIABLE)
        unset = "" if known else f" The environment variable {DATA_VARIABLE} is not set."
        near = next(filter(None, map(did_you_mean_file, candidates)), "")
        raise InputError(
            f"There is no data folder {said}.{near} Give its path, absolute or relative to "
            f"the study file or to {DATA_VARIABLE}.{unset}"
        )
    if os.path.isfile(there[0]):
        why = f"{said} is a file. Name the folder that holds {INDEX_FILE}; for a single file make "
        why += "one with: discover data import."
    elif not os.access(there[0], os.R_OK | os.X_OK):
        why = f"The folder {said} may not be read. Ask for the right to read it."
    elif os.path.isfile(there[0] / TESTS_FILE):
        why = (
            f"The folder {said} holds tests at several temperatures ({TESTS_FILE}), and a fit "
            f"takes one. Copy the table of one temperature to {SWEEP_FILE}."
        )
    else:
        why = (
            f"The folder {said} has no {INDEX_FILE}. Make a data folder of your files with: "
            f"discover data import {said} --out FOLDER. Or write it, with a column 'file' and one "
            f"line a run, or one of the tables {', '.join(DATA_FILES[1:])}."
        )
    raise InputError(why)


def files_of(root: Path) -> list[Path]:
    """Return the files of a folder that `load_dataset` reads samples from, and ``runs.csv``.

    Raises InputError if ``runs.csv`` is wrong.
    """
    names = [*DATA_FILES, *read_index(root).columns["file"]]
    return [root / name for name in dict.fromkeys(names) if os.path.lexists(root / name)]


def load_dataset(
    folder: str | Path, clock_factor: str | None = None, base: str | Path | None = None,
    rate_is_measured: bool = False,
    rate_before: str | None = None, sequence: str | None = None,
    amplitude_sweep_rad_s: float | None = None,
) -> Dataset:  # fmt: skip
    """Return the runs of a folder, and its linear sweep if it has one, in SI units.

    A column may carry another unit in its name, such as ``stress_kPa``. A run without a shear rate
    must have the strain, from which its rate is derived (metadata ``shear_rate_source``); one of
    more than `MOST_SAMPLES` samples is thinned (``thinned``). Raises InputError if something in the
    folder is wrong: what, where and how to mend it.

    Parameters
    ----------
    folder, base
        As in `resolve_folder`.
    clock_factor
        Column of ``runs.csv`` with instrument time = time / factor, if any.
    rate_is_measured
        Whether the shear rate was measured and not commanded.
    rate_before
        Column of ``runs.csv`` with the shear rate of the steady flow before each run, in 1/s or
        the unit at the end of its name; an empty cell is a start from rest. By default a column
        that begins with ``rate_before`` gives that of the runs whose ``start`` is ``steady``, and
        the others start from rest.
    sequence
        Column that orders runs made one after another on one sample, such as start times; by
        default every run has a sample of its own.
    amplitude_sweep_rad_s
        Frequency of ``amplitude_sweep.csv``, if it has no column ``omega_rad_s``.

    Examples
    --------
    >>> import discover as dc
    >>> data = dc.load_dataset("melt")  # doctest: +SKIP
    """
    root = resolve_folder(folder, base)
    return _read_folder(
        root, root.resolve().name, clock_factor, rate_is_measured, rate_before, sequence,
        amplitude_sweep_rad_s,
    )  # fmt: skip


def _read_folder(
    root: Path, name: str, clock_factor: str | None = None, rate_is_measured: bool = False,
    rate_before: str | None = None, sequence: str | None = None,
    amplitude_sweep_rad_s: float | None = None,
) -> Dataset:  # fmt: skip
    """Return what a folder that is there holds, under a name that messages call it by."""
    columns = {"clock_factor": clock_factor, "rate_before": rate_before, "sequence": sequence}
    for option, column in columns.items():
        if not isinstance(column, str | None):
            raise InputError(f"{option} is the name of a column; got {short(column)}.")
    if not isinstance(rate_is_measured, bool | np.bool_):
        raise InputError(f"rate_is_measured must be True or False; got {short(rate_is_measured)}.")
    frequency = amplitude_sweep_rad_s
    if frequency is not None and not as_number("amplitude_sweep_rad_s", frequency) > 0.0:
        raise InputError(f"amplitude_sweep_rad_s must be positive; got {short(frequency)}.")
    index = read_index(root)
    factors = read_clock_factors(index, clock_factor)
    read = read_folder(
        root, index, rates_before(index, rate_before), factors, bool(rate_is_measured), frequency
    )
    problems = Problems()
    for wrong in read.wrong.values():
        with problems.collected():
            raise wrong
    if read.aside and not read.runs and not problems:
        first, why = next(iter(read.aside.items()))
        raise InputError(f"No run of {name!r} can be fitted: {first} is set aside, since {why}.")
    problems.require_none(name)
    runs = list(read.runs.values())
    if sequence is not None and runs:
        used = [index.columns["file"].index(run.name) for run in runs]
        runs = in_sequence(runs, read_column(index, "sequence", sequence)[used])
    provenance, path = "", root / PROVENANCE_FILE
    if os.path.isfile(path) and is_inside(root, PROVENANCE_FILE):
        provenance = read_bytes(path, path.name).decode("utf-8", "replace")
    aside = {**read.unused, **read.aside}
    return Dataset(name, tuple(runs), read.sweep, provenance, aside, read.tables)


@dataclass
class Folder:
    """What was read of a data folder, by file, and what is wrong with it."""

    samples: dict[str, Table] = field(default_factory=dict)  # of the runs, as text
    runs: dict[str, Run] = field(default_factory=dict)
    aside: dict[str, str] = field(default_factory=dict)  # why runs cannot be fitted
    sweep: LinearSweep | None = None
    tables: dict[str, Run] = field(default_factory=dict)  # material functions, by kind
    unused: dict[str, str] = field(default_factory=dict)  # why tables cannot be used
    wrong: dict[tuple[str, str], InputError] = field(default_factory=dict)  # by subject and file


def read_folder(
    root: Path, index: Table, before: Sequence[float] | np.ndarray | None,
    factors: Sequence[float] | np.ndarray | None = None, rate_is_measured: bool = False,
    frequency: float | None = None,
) -> Folder:  # fmt: skip
    """Return all that can be read of a folder, after its index.

    `before`, `factors`: rate before in 1/s and clock factor of each run. `frequency`: of an
    amplitude sweep without its own, in rad/s.
    """
    read, names = Folder(), index.columns["file"]
    for row, file in enumerate(names):
        factor = 1.0 if factors is None else float(factors[row])
        steady = None if before is None else float(before[row])
        try:
            table = table_of_run(root, file)
            read.runs[file] = read_run(table, index, row, factor, rate_is_measured, steady)
            read.samples[file] = table
        except SetAside as why:
            read.aside[file] = str(why)
        except InputError as wrong:
            read.wrong["run", file] = wrong
    try:
        read.sweep = find_sweep(root)
    except InputError as wrong:
        read.wrong["sweep", SWEEP_FILE] = wrong
    try:
        read.tables, read.unused = read_material_functions(root, names, frequency)
    except InputError as wrong:
        read.wrong["tables", ""] = wrong
    return read


def find_sweep(root: Path) -> LinearSweep | None:
    """Return the linear sweep of a folder, sorted; None without one, InputError if it is wrong."""
    table = table_in(root, SWEEP_FILE)
    if table is None:
        return None
    quantities = units.ANGULAR_FREQUENCY, units.STORAGE_MODULUS, units.LOSS_MODULUS
    columns = table.all_required(*quantities)
    table.require_positive(*quantities)
    order = np.argsort(columns[0], kind="stable")
    return LinearSweep(*(values[order] for values in columns))


_KINDS = tuple(name.removesuffix(".csv") for name in DATA_FILES if name != INDEX_FILE)

_LONGEST_NAME = 200  # bytes of a run's name; file systems take 255, and endings follow


def from_dataframe(
    samples: pd.DataFrame | None = None, runs: pd.DataFrame | None = None,
    tables: Mapping[str, pd.DataFrame] | None = None, name: str = "data in memory", **options: Any,
) -> Dataset:  # fmt: skip
    """Return the data set that tables in memory hold, as `load_dataset` would read it from files.

    Messages (InputError) count lines as in a CSV file: the headings are line 1.

    Parameters
    ----------
    samples
        The samples of all runs, one line each: columns of a run's file, and ``run``, which names
        the run; without it all are one run. `Dataset.to_dataframe` returns such a table.
    runs
        What ``runs.csv`` would say: the column ``file`` (or ``run``) and metadata such as ``flow``,
        ``control``, ``start`` or ``temperature_C``; by default every run is in shear from rest.
    tables
        ``lve``, ``flow_curve``, ``amplitude_sweep``, ``relaxation`` or ``creep``, by name.
    name, **options
        Of the data set; as `load_dataset` has them, such as ``clock_factor="time_factor"``.

    Examples
    --------
    >>> import discover as dc
    >>> import pandas as pd
    >>> samples = pd.DataFrame({"time_s": [0.0, 0.5, 1.0], "shear_rate_1_s": 0.5})
    >>> dc.from_dataframe(samples.assign(stress_Pa=[0.0, 19.7, 31.6], run="slow"))
    <Dataset 'data in memory': 1 run, 3 samples>
    """
    if not (tables is None or isinstance(tables, Mapping)):
        raise InputError(f"tables must be a mapping of names to tables; got {short(tables)}.")
    if not isinstance(name, str):
        raise InputError(f"The name of a data set must be text; got {short(name)}.")
    samples, runs = (_plain(label, one) for label, one in (("samples", samples), ("runs", runs)))
    tables = {kind: _plain(kind, table) for kind, table in (tables or {}).items()}
    known = [*signature(_read_folder).parameters][2:]
    if no_option := [one for one in options if one not in known]:
        raise InputError(unknown_name("option", no_option[0], known, "from_dataframe"))
    if unknown := [kind for kind in tables if kind not in _KINDS]:
        raise InputError(unknown_name("table", unknown[0], _KINDS))
    by_run = _by_run(samples, name)
    # half a character, which no file can hold, is spelled out
    as_text: dict[str, Any] = {"index": False, "errors": "backslashreplace"}
    with TemporaryDirectory() as folder:
        for run, table in by_run.items():
            table.to_csv(Path(folder) / run, **as_text)
        index = pd.DataFrame({"file": list(by_run)}) if runs is None else _index(runs, by_run)
        if len(index):
            index.to_csv(Path(folder) / INDEX_FILE, **as_text)
        for kind, table in tables.items():
            table.to_csv(Path(folder) / f"{kind}.csv", **as_text)
        if not any(Path(folder).iterdir()):
            raise InputError("There is no sample and no table; give one with samples at least.")
        return _read_folder(Path(folder), name, **options)


def _plain(label: str, table: pd.DataFrame | None) -> Any:
    """Return a table with the named levels of its index as columns; InputError if it is none."""
    if not (table is None or isinstance(table, pd.DataFrame)):
        raise InputError(f"{label} must be a pandas DataFrame; got a {type(table).__name__}.")
    if table is None:
        return None
    if odd := [one for one in table.columns if not isinstance(one, str)]:
        raise InputError(
            f"The columns of {label} must have text for names, on one level; got {short(odd[0])}. "
            "Rename them, or flatten them with reset_index()."
        )
    named = [n for n in table.index.names if isinstance(n, str) and n not in table.columns]
    return (table.reset_index(level=named) if named else table).reset_index(drop=True)


def _can_name_a_run(name: object) -> bool:
    """Return whether a name can be one of a run, whose samples pass through a file of that name."""
    if not isinstance(name, str) or name in DATA_FILES or name.strip(". ") == "":
        return False
    size = len(name.encode("utf-8", "surrogatepass"))
    return size <= _LONGEST_NAME and not {"/", "\\"} & {*name} and name.isprintable()


def _by_run(samples: pd.DataFrame | None, name: str) -> dict[str, pd.DataFrame]:
    if samples is None or not len(samples):
        return {}
    if "run" not in samples:
        samples = samples.assign(run=name)
    if samples.columns.duplicated().any():
        twice = samples.columns[samples.columns.duplicated()][0]
        raise InputError(f"samples has the column {short(twice)} twice. Leave one of them out.")
    if wrong := [run for run in samples["run"] if not _can_name_a_run(run)]:
        raise InputError(
            f"The column run must hold names of runs: text of at most {_LONGEST_NAME} characters "
            f"that can name a file, and not that of a table; got {short(wrong[0])}."
        )
    return {
        # a quantity that this run did not record
        str(run): table.drop(columns="run").dropna(axis="columns", how="all")
        for run, table in samples.groupby("run", sort=False)
    }


def _index(runs: pd.DataFrame, by_run: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    index = runs.rename(columns={"run": "file"})
    if "file" not in index:
        raise InputError(
            f"runs has no column 'file' or 'run'; its columns are {', '.join(map(str, runs))}."
        )
    if missing := [run for run in index["file"] if run not in by_run]:
        raise InputError(
            f"runs names {missing[0]!r}, of which there is no sample; samples has "
            f"{', '.join(by_run) or 'none'}."
        )
    return index
