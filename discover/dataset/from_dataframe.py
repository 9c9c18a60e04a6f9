"""Data sets from tables in memory: what a data folder holds, without the folder."""

from collections.abc import Mapping
from dataclasses import replace
from inspect import signature
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pandas as pd

from discover.dataset.dataset import Dataset
from discover.dataset.load import DATA_FILES, load_dataset
from discover.dataset.read_run import INDEX_FILE
from discover.errors import InputError
from discover.plain_numbers import short
from discover.words import unknown_name

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
    <Dataset 'data in memory': 1 runs, 3 samples>
    """
    if not (tables is None or isinstance(tables, Mapping)):
        raise InputError(f"tables must be a mapping of names to tables; got {short(tables)}.")
    if not isinstance(name, str):
        raise InputError(f"The name of a data set must be text; got {short(name)}.")
    for label, table in [("samples", samples), ("runs", runs), *(tables or {}).items()]:
        if not (table is None or isinstance(table, pd.DataFrame)):
            raise InputError(f"{label} must be a pandas DataFrame; got a {type(table).__name__}.")
        odd = [] if table is None else [one for one in table.columns if not isinstance(one, str)]
        if odd:
            raise InputError(
                f"The columns of {label} must have text for names, on one level; got "
                f"{short(odd[0])}. Rename them, or flatten them with reset_index()."
            )
    known = list(signature(load_dataset).parameters)
    if no_option := [one for one in options if one not in known]:
        raise InputError(unknown_name("option", no_option[0], known[1:], "from_dataframe"))
    if unknown := [kind for kind in tables or {} if kind not in _KINDS]:
        raise InputError(unknown_name("table", unknown[0], _KINDS))
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


def _can_name_a_run(name: object) -> bool:
    """Return whether a name can be one of a run, whose samples pass through a file of that name."""
    if not isinstance(name, str) or name in DATA_FILES or name.strip(". ") == "":
        return False
    size = len(name.encode("utf-8", "surrogatepass"))
    return size <= _LONGEST_NAME and not {"/", "\\"} & {*name} and name.isprintable()


def _by_run(samples: pd.DataFrame | None, name: str) -> dict[str, pd.DataFrame]:
    """Return the samples of each run, in the order of the table, without columns it lacks."""
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
