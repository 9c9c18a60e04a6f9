"""Which test a line of ``runs.csv`` declares: flow, control, and what came before t = 0."""

import math
from dataclasses import dataclass

from discover.dataset.tables.table import Table
from discover.errors import InputError
from discover.protocols.kinematics import KINDS
from discover.words import did_you_mean

_VALUES = {"flow": KINDS, "control": ("rate", "stress"), "start": ("rest", "periodic", "steady")}
"""Columns of ``runs.csv`` that say what was done, with their values; the first is the default."""

_LARGEST_STEP = 1000.0
"""Strain beyond which a step is a slip of unit, such as per cent."""


@dataclass(frozen=True)
class DeclaredTest:
    """What a line of ``runs.csv`` says was done.

    `flow`, `control`, `start`: as in the columns of these names.
    `step_strain`: strain put on before t = 0; zero where there was none.
    `step_time`: time over which it was put on, in s; zero is at once.
    `rate_before`: rate of the steady flow before t = 0, in 1/s.
    """

    flow: str
    control: str
    start: str
    step_strain: float
    step_time: float
    rate_before: float


def declared_test(index: Table, row: int, rate_before: float | None) -> DeclaredTest:
    """Return which test the run on a line of ``runs.csv`` is.

    `index`: ``runs.csv``. `row`: counted from 0. `rate_before`: rate of the steady flow before the
    run, in 1/s, where the study says so. Raises InputError if a column that says what was done
    holds something that it cannot, or two contradict each other.
    """
    flow, control, start = (_value(index, row, column) for column in _VALUES)
    step, time = (_number(index, row, column) or 0.0 for column in ("step_strain", "step_time_s"))
    where = f"Line {index.lines[row]} of {index.name}"
    if abs(step) > _LARGEST_STEP:
        raise InputError(
            f"{where}: step_strain is {step:g}. A strain is a pure number, 1 for 100 %; correct it."
        )
    if time < 0.0:
        raise InputError(f"{where}: step_time_s is {time:g}. Give a time from 0 on.")
    if step and (start != "rest" or rate_before):
        raise InputError(
            f"{where} declares both a step of strain and a flow before it. Leave one of them out."
        )
    if start == "periodic" and rate_before:
        raise InputError(
            f"{where} declares both an oscillation and a steady flow before t = 0. Leave one of "
            "them out."
        )
    _number(index, row, "temperature_C")
    return DeclaredTest(flow, control, start, step, time, rate_before or 0.0)


def reason_to_set_aside(index: Table, row: int, rate_before: bool) -> str | None:
    """Return why the run on a line of ``runs.csv`` cannot be fitted; None if it can.

    `rate_before`: whether it is known from which steady flow each run starts. Raises InputError as
    `declared_test`.
    """
    if declared_test(index, row, None).start == "steady" and not rate_before:
        return (
            "it starts from a steady flow; name the column of runs.csv that holds the rate of that "
            "flow in the study (rate_before)"
        )
    return None


def _value(index: Table, row: int, column: str) -> str:
    values = _VALUES[column]
    cell = _cell(index, row, column)
    if column == "start" and _is_number(cell):
        return values[0]  # a time at which the run started, as `sequence` takes it
    if cell and cell not in values:
        raise InputError(
            f"{column} in {index.name} holds {cell!r} on line {index.lines[row]}."
            f"{did_you_mean(cell, values)} Write one of "
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
