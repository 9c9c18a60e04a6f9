"""Data sets from tables in memory: what a data folder holds, without the folder."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pandas as pd

from discover.dataset.dataset import Dataset
from discover.dataset.load import DATA_FILES, INDEX_FILE, load_dataset
from discover.errors import InputError

_KINDS = tuple(name.removesuffix(".csv") for name in DATA_FILES if name != INDEX_FILE)


def from_dataframe(
    samples: pd.DataFrame | None = None,
    runs: pd.DataFrame | None = None,
    tables: Mapping[str, pd.DataFrame] | None = None,
    name: str = "data in memory",
    **options: Any,
) -> Dataset:
    """Return the data set that tables in memory hold, as `load_dataset` would read it from files.

    Rates, units, flows and whatever else is checked or derived are those of a data folder. Messages
    count lines as in a CSV file: the headings are line 1.

    Parameters
    ----------
    samples
        The samples of all runs, one line each: columns of a run's file (``time_s``,
        ``shear_rate_1_s``, ``stress_Pa`` and so on), and ``run``, which names the run. Without that
        column all samples are one run. `Dataset.to_dataframe` returns such a table.
    runs
        What ``runs.csv`` would say: the column ``file`` (or ``run``) and metadata such as ``flow``,
        ``control``, ``start`` or ``temperature_C``; by default every run is in shear from rest.
    tables
        Tables beside the runs by name: ``lve``, ``flow_curve``, ``amplitude_sweep``,
        ``relaxation``, ``creep``, with the columns of the files.
    name
        Of the data set.
    **options
        As `load_dataset` has them, such as ``clock_factor="time_factor"``.

    Raises
    ------
    InputError
        If something in the tables is wrong; the message says what, where and how to mend it.

    Examples
    --------
    >>> import discover as dc
    >>> import pandas as pd
    >>> samples = pd.DataFrame({"time_s": [0.0, 0.5, 1.0], "shear_rate_1_s": 0.5})
    >>> samples["stress_Pa"] = [0.0, 19.7, 31.6]
    >>> dc.from_dataframe(samples.assign(run="slow"))
    <Dataset 'data in memory': 1 runs, 3 samples>
    """
    for label, table in [("samples", samples), ("runs", runs), *(tables or {}).items()]:
        if not (table is None or isinstance(table, pd.DataFrame)):
            raise InputError(f"{label} must be a pandas DataFrame; got a {type(table).__name__}.")
    unknown = [kind for kind in tables or {} if kind not in _KINDS]
    if unknown:
        raise InputError(f"There is no table {unknown[0]!r}; it may be {', '.join(_KINDS)}.")
    by_run = _by_run(samples, name)
    with TemporaryDirectory() as folder:
        for run, table in by_run.items():
            table.to_csv(Path(folder) / run, index=False)
        index = pd.DataFrame({"file": list(by_run)}) if runs is None else _index(runs, by_run)
        if len(index):
            index.to_csv(Path(folder) / INDEX_FILE, index=False)
        for kind, table in (tables or {}).items():
            table.to_csv(Path(folder) / f"{kind}.csv", index=False)
        if not any(Path(folder).iterdir()):
            raise InputError("There is no sample and no table; give one with samples at least.")
        return replace(load_dataset(folder, **options), name=name)


def _by_run(samples: pd.DataFrame | None, name: str) -> dict[str, pd.DataFrame]:
    """Return the samples of each run, in the order of the table, without columns it lacks."""
    if samples is None or not len(samples):
        return {}
    if "run" not in samples:
        samples = samples.assign(run=name)
    found = {}
    for run, table in samples.groupby("run", sort=False, dropna=False):
        if not isinstance(run, str) or not run or {"/", "\\"} & {*run} or run in DATA_FILES:
            raise InputError(
                f"The column run must hold names of runs, and none that a path or a table has; got "
                f"{run!r}."
            )
        # a quantity that this run did not record
        found[run] = table.drop(columns="run").dropna(axis="columns", how="all")
    return found


def _index(runs: pd.DataFrame, by_run: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    index = runs.rename(columns={"run": "file"})
    if "file" not in index:
        raise InputError(
            f"runs has no column 'file' or 'run'; its columns are {', '.join(map(str, runs))}."
        )
    missing = [run for run in index["file"] if run not in by_run]
    if missing:
        raise InputError(
            f"runs names {missing[0]!r}, of which there is no sample; samples has "
            f"{', '.join(by_run) or 'none'}."
        )
    return index
