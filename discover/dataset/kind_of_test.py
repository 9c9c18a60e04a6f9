"""Which test a line of ``runs.csv`` declares, and whether a run of that kind can be fitted.

A run that is no transient in shear from a known state must not be read as one: it is set aside,
with the reason, and the other runs are used.
"""

import math

from discover.dataset.table import Table
from discover.errors import InputError

_VALUES = {
    "flow": ("shear", "uniaxial", "planar", "biaxial"),
    "control": ("rate", "stress"),
    "start": ("rest", "periodic", "steady"),
}
"""Columns of ``runs.csv`` that say what was done, with their values; the first is the default."""

_NUMBERS = ("step_strain", "step_time_s", "temperature_C")


def reason_to_set_aside(index: Table, row: int, rate_before: bool = False) -> str | None:
    """Return why the run on a line of ``runs.csv`` cannot be fitted; None if it can.

    Parameters
    ----------
    index
        ``runs.csv``.
    row
        Counted from 0.
    rate_before
        Whether the study says from which steady flow each run starts.

    Raises
    ------
    InputError
        If a column that says what was done holds something that it cannot.
    """
    declared = {column: _value(index, row, column) for column in _VALUES}
    step = {column: _number(index, row, column) for column in _NUMBERS}
    if declared["flow"] != "shear":
        return f"it is {declared['flow']} extension, and only shear is fitted"
    if step["step_strain"]:
        return "it is relaxation after a step of strain, and runs from rest alone are fitted"
    if declared["start"] == "periodic":
        return "it was recorded in steady alternation, and runs from rest alone are fitted"
    if declared["start"] == "steady" and not rate_before:
        return (
            "it starts from a steady flow; name the column of runs.csv that holds the rate of that "
            "flow in the study (rate_before)"
        )
    return None


def stress_was_imposed(index: Table, row: int) -> bool:
    """Return whether a line of ``runs.csv`` says that the stress was imposed and not the rate."""
    return _value(index, row, "control") == "stress"


def _value(index: Table, row: int, column: str) -> str:
    values = _VALUES[column]
    cell = _cell(index, row, column)
    if column == "start" and _is_number(cell):
        return values[0]  # a time at which the run started, as `sequence` takes it
    if cell and cell not in values:
        raise InputError(
            f"{column} in {index.name} holds {cell!r} on line {index.lines[row]}. Write one of "
            f"{', '.join(values)}; an empty cell is {values[0]}."
        )
    return cell or values[0]


def _number(index: Table, row: int, column: str) -> float | None:
    cell = _cell(index, row, column)
    if cell and not _is_number(cell):
        raise InputError(
            f"{column} in {index.name} holds {cell!r} on line {index.lines[row]}. Write a number, "
            "or leave the cell empty."
        )
    return float(cell) if cell else None


def _is_number(cell: str) -> bool:
    try:
        return math.isfinite(float(cell))
    except ValueError:
        return False


def _cell(index: Table, row: int, column: str) -> str:
    return index.columns[column][row].strip() if column in index.columns else ""
