"""What ``runs.csv`` says of all runs: their files, clock factors and steady flows before."""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from discover.dataset.read_run import INDEX_FILE
from discover.dataset.tables import units
from discover.dataset.tables.table import Table, is_inside, is_number, read_table, shown
from discover.errors import InputError, Problems
from discover.plain_numbers import short
from discover.words import did_you_mean


def read_index(root: Path) -> Table:
    """``runs.csv``, empty where there is none; InputError if the column ``file`` is wrong."""
    if not os.path.lexists(root / INDEX_FILE):
        return Table(INDEX_FILE, {"file": []}, [])
    index = read_table(root / INDEX_FILE)
    if "file" not in index.columns:
        raise InputError(
            f"{INDEX_FILE} has no column 'file'; its columns are {index.listed}. Add "
            "it, with the file name of each run."
        )
    seen: set[str] = set()
    problems = Problems()
    for line, name in zip(index.lines, index.columns["file"], strict=True):
        where = f"Line {line} of {INDEX_FILE}"
        if not name:
            problems.add(f"{where} names no file. Name one, or remove the line.")
        elif not name.isprintable():
            problems.add(f"{where} names {name!r}; no file is named so. Correct it.")
        elif name in seen:
            problems.add(f"{INDEX_FILE} names {name} twice, again on line {line}; keep one.")
        elif not is_inside(root, name):
            problems.add(
                f"{where} names {name!r}, which lies outside the folder or is a link to there. Put "
                "the file itself in the folder and name it without a path."
            )
        seen.add(name)
    problems.require_none(INDEX_FILE)
    return index


def read_clock_factors(index: Table, column: str | None) -> Float[np.ndarray, " runs"]:
    """Return the clock factor of every run; ones if no column is named, InputError if wrong."""
    if column is None:
        return np.ones(len(index))
    cells = _cells(index, "clock_factor", column)
    # what is no number is as wrong as what is not positive, and is said with it
    wrong = np.array([not (is_number(cell) and float(cell) > 0.0) for cell in cells])
    rows = np.flatnonzero(wrong)
    if rows.size:
        row = int(rows[0])
        raise InputError(
            f"{column} in {INDEX_FILE} must hold positive numbers; line {index.lines[row]} holds "
            f"{shown(cells[row])}. Instrument time is time / {column}; correct that line, or write "
            f"1 where no time was shifted.{index.like_it(rows)}"
        )
    return index.numbers(column)


def read_column(index: Table, key: str, column: str) -> Float[np.ndarray, " runs"]:
    """Return the numbers in a column of ``runs.csv`` that a key names; InputError if none are."""
    _cells(index, key, column)
    return index.numbers(column)


def _cells(index: Table, key: str, column: str) -> Sequence[str]:
    """Return a column of ``runs.csv`` that a key names, as text; InputError if it is missing."""
    if column not in index.columns:
        raise InputError(
            f"{key} names the column {short(column)}, but {INDEX_FILE} has only {index.listed}."
            f"{did_you_mean(column, index.columns)} Correct the name, or leave {key} out."
        )
    return index.columns[column]


def rates_before(index: Table, column: str | None) -> Float[np.ndarray, " runs"] | None:
    """Return the rate of the steady flow before each run, in 1/s; None where nothing says it.

    Without a name, a column that begins with ``rate_before`` holds the rates of runs declared to
    start from a steady flow. Raises InputError as `rates_in`.
    """
    steady = starts_steady(index)
    if column is not None:
        return rates_in(index, column)
    column = column_of_rates_before(index)
    if column is None:
        return None
    rates = _numbers_before(index, column)
    if not np.any(steady):
        return None
    return np.where(steady, rates * units.heading_factor(column, units.SHEAR_RATE), 0.0)


def starts_steady(index: Table) -> Bool[np.ndarray, " runs"]:
    """Return which runs ``runs.csv`` declares to start from a steady flow."""
    starts = index.columns.get("start", [""] * len(index))
    return np.array([cell == "steady" for cell in starts], dtype=bool)


def column_of_rates_before(index: Table) -> str | None:
    """Return the column that holds the rates of runs from a steady flow where no key names one."""
    return next((name for name in index.columns if name.startswith("rate_before")), None)


def rates_in(index: Table, column: str) -> Float[np.ndarray, " runs"]:
    """Rates before runs in 1/s, 0 (rest) where a cell is empty; InputError if they are none."""
    return _numbers_before(index, column) * units.heading_factor(column, units.SHEAR_RATE)


def _numbers_before(index: Table, column: str) -> Float[np.ndarray, " runs"]:
    given = zip(_cells(index, "rate_before", column), starts_steady(index), strict=True)
    filled = [cell if cell or steady else "0" for cell, steady in given]
    return replace(index, columns={**index.columns, column: filled}).numbers(column)
