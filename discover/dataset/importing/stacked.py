"""The tests that stand one below the other in one table, or row by row in turn.

What repeats tells them apart: a word or number in a column of its own, a temperature, a set value,
a clock or a series of rates that starts again.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from discover.dataset.importing.mapping import Mapping
from discover.dataset.importing.readings import Readings
from discover.dataset.importing.text_export import OF_TESTS, Block, plain_words
from discover.dataset.importing.text_rows import is_number
from discover.errors import InputError

_FEWEST = 3
"""Rows of a test."""

_SAME_TEMPERATURE = 1.5
"""Difference in °C up to which neighbouring readings are of one temperature."""

_DRIFT = 3.0
"""Spread in °C, up to which readings without a gap are one temperature, and no ramp."""

_BACK = 0.1
"""Share of the way so far, within which a clock is back at its start."""

_MOSTLY = 0.6
"""Share of steps in one direction, from which on values go that way."""

_Rows = Int[np.ndarray, " m"]


@dataclass(frozen=True)
class _Piece:
    """Rows of one test, and whether those before are of another sample or temperature."""

    rows: _Rows
    apart: bool = False
    told_by: tuple[int, ...] = ()


def tests_in_rows(block: Block, mapping: Mapping, name: str) -> list[Block]:
    """Return the tests that stand one below the other, or row by row in turn.

    `mapping`, `name`: what the user says of the file, and its name.
    """
    readings = Readings.of(block, mapping, name)
    pieces = [_Piece(np.arange(len(readings)), block.apart)]
    for split in (_by_words, _by_temperature, _by_restart, _by_set_value):
        pieces = [part for piece in pieces for part in split(readings, piece)]
    if len(pieces) == 1:
        return [block]
    parts = []
    for piece in pieces:
        told = tuple(dict.fromkeys((*piece.told_by, *_told_by(block, pieces))))
        first = block.cells[int(piece.rows[0])]
        label = ", ".join(_said(block.columns[i], first[i]) for i in told[:2])
        parts.append(replace(
            block,
            name=_joined(block.name, label or f"from line {block.line + int(piece.rows[0])} on"),
            cells=tuple(block.cells[int(i)] for i in piece.rows),
            line=block.line + int(piece.rows[0]),
            apart=piece.apart,
            told_by=tuple(block.columns[i][0] for i in told),
        ))  # fmt: skip
    return parts


def _joined(name: str, label: str) -> str:
    return ", ".join(filter(None, (name, label)))


def _said(column: tuple[str, str], cell: str) -> str:
    name, unit = column
    return f"{name} {cell} {unit}".strip() if is_number(cell) else cell


def _told_by(block: Block, pieces: Sequence[_Piece]) -> list[int]:
    """Return the columns that have one value in each of the tests, and not one in all."""
    told = []
    for i in range(len(block.columns)):
        values = [{block.cells[int(row)][i] for row in piece.rows} for piece in pieces]
        if all(len(one) == 1 for one in values) and len(set.union(*values)) > 1:
            told.append(i)
    return told


def _by_words(readings: Readings, piece: _Piece) -> list[_Piece]:
    """Split where a column says of which sample, run or step a row is."""
    for i, (name, _) in enumerate(readings.block.columns):
        if found := OF_TESTS.fullmatch(plain_words(name)):
            words = np.array([readings.block.cells[int(row)][i] for row in piece.rows])
            parts = _by_value(piece, words, i)
            if len(parts) > 1:
                return parts if found["sample"] else [replace(one, apart=False) for one in parts]
    return [piece]


def _by_value(piece: _Piece, values: np.ndarray, column: int) -> list[_Piece]:
    """Return the rows of each value, in the order of their first; all of them if one has few."""
    _, first, group = np.unique(values, return_index=True, return_inverse=True)
    if len(first) < 2 or np.min(np.bincount(group)) < _FEWEST:
        return [piece]
    told = (*piece.told_by, column)
    return [_Piece(piece.rows[group == k], True, told) for k in np.argsort(first)]


def _by_temperature(readings: Readings, piece: _Piece) -> list[_Piece]:
    """Split where readings of temperature gather about a few values, other than along a record."""
    if not readings.alone("temperature"):
        return [piece]
    values = readings.get("temperature")
    assert values is not None
    degrees = values[piece.rows]
    known = np.isfinite(degrees)
    if np.sum(known) < 2 * _FEWEST or (_goes_on(readings, piece) and not _sweeps(readings, piece)):
        return [piece]
    order = np.sort(degrees[known])
    cuts = order[1:][np.diff(order) > _SAME_TEMPERATURE] - 0.5 * _SAME_TEMPERATURE
    group = np.searchsorted(cuts, degrees)
    # a row without a reading is at the temperature of that before it
    last = np.maximum.accumulate(np.where(known, np.arange(len(known)), 0))
    group = group[last]
    spreads = [np.ptp(degrees[known & (group == k)]) for k in np.unique(group)]
    return [piece] if max(spreads) > _DRIFT else _by_value(
        piece, group, readings.columns["temperature"])  # fmt: skip


def _by_set_value(readings: Readings, piece: _Piece) -> list[_Piece]:
    """Split by the column whose values, held over rows, leave a clock that only rises in each."""
    time = _values(readings, "time", piece)
    if time is None or np.all(np.diff(time) > 0.0):
        return [piece]
    best = [piece]
    for i in range(len(readings.block.columns)):
        if i == readings.columns["time"]:
            continue
        cells = np.array([readings.block.cells[int(row)][i] for row in piece.rows])
        if len(np.unique(cells)) > len(cells) // _FEWEST:
            continue
        parts = _by_value(piece, cells, i)
        rises = all(np.all(np.diff(time[np.isin(piece.rows, part.rows)]) > 0.0) for part in parts)
        if len(parts) > 1 and rises and (len(best) == 1 or len(parts) < len(best)):
            best = parts
    # one after the other, as creep and recovery are, they may be one sample's
    in_turn = all(np.all(np.diff(part.rows) == 1) for part in best)
    return [replace(part, apart=piece.apart) for part in best] if in_turn else best


def _by_restart(readings: Readings, piece: _Piece) -> list[_Piece]:
    """Split where the clock, the frequencies or the rates start again."""
    for key in ("time", "omega", "shear_rate"):
        values = _values(readings, key, piece)
        if values is None or (key == "omega" and _strain_varies(readings)):
            continue
        if key != "time":
            values = np.log(np.maximum(np.abs(values), 1e-300))
        elif np.mean(np.diff(values) > 0.0) < _MOSTLY:
            continue
        cuts = _restarts(values)
        if cuts:
            parts = np.split(piece.rows, cuts)
            apart = [piece.apart, *([key != "time"] * len(cuts))]
            return [
                _Piece(rows, one, piece.told_by) for rows, one in zip(parts, apart, strict=True)
            ]
    return [piece]


def _restarts(values: Float[np.ndarray, " m"]) -> list[int]:
    """Return where values that go one way jump back to where they began."""
    steps = np.diff(values)
    up, down = np.mean(steps > 0.0), np.mean(steps < 0.0)
    if max(up, down) < _MOSTLY:
        return []
    cuts: list[int] = []
    begin = 0
    for i in np.flatnonzero(steps < 0.0 if up > down else steps > 0.0) + 1:
        way = abs(values[i - 1] - values[begin])
        if abs(values[i] - values[begin]) <= _BACK * way:
            cuts.append(int(i))
            begin = int(i)
    sizes = np.diff([0, *cuts, len(values)])
    return cuts if np.min(sizes) >= _FEWEST else []


def _values(readings: Readings, key: str, piece: _Piece) -> Float[np.ndarray, " m"] | None:
    """Return a column of its own in the rows of a test; None if it lacks one in some."""
    if not readings.alone(key):
        return None
    try:
        values = readings.get(key)
    except InputError:  # said where the block is read, if it is
        return None
    assert values is not None
    values = values[piece.rows]
    return values if len(values) > 2 * _FEWEST - 1 and np.all(np.isfinite(values)) else None


def _goes_on(readings: Readings, piece: _Piece) -> bool:
    time = _values(readings, "time", piece)
    return time is not None and bool(np.all(np.diff(time) > 0.0))


def _sweeps(readings: Readings, piece: _Piece) -> bool:
    """Return whether frequencies or rates go from row to row: a table, no record in time."""
    for key in ("omega", "shear_rate"):
        values = _values(readings, key, piece)
        if values is not None and len(np.unique(values)) > len(values) // 4:
            size = np.abs(values)
            if np.max(size) > 3.0 * np.percentile(size, 5.0):
                return True
    return False


def _strain_varies(readings: Readings) -> bool:
    try:
        strain = readings.get("strain_amplitude")
    except InputError:
        return False
    if strain is None or not np.isfinite(strain).any():
        return False
    size = np.abs(strain[np.isfinite(strain)])
    return bool(np.max(size) > 1.2 * np.min(size))
