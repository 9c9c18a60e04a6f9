"""Blocks of numbers in a table of cells, with the names and units above them.

One reader serves plain tables, TRIOS (text, CSV, "Export to LIMS" and spreadsheets; blocks headed
``[step]``), RheoCompass (blocks headed ``Interval data:``), rSpace and RheoWin, since all are the
same thing: a line of names, perhaps a line of units, then lines of numbers, some of which begin
with a word. What a block is called is read from the lines above it, or is that word. The reader of
hermes-rheo was considered for TRIOS: its version 2.0.0 pins older scipy, pandas and matplotlib
than are used here and brings piblin, mastercurves, openpyxl and numdifftools along, for a format of
four lines; it does not read RheoCompass, and TRIOS' other text export neither.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
from numpy.typing import ArrayLike

from discover.dataset.importing.header_constants import Constant, constants_of, name_and_unit
from discover.dataset.importing.text_rows import is_number
from discover.dataset.tables.unit_text import read_unit
from discover.errors import InputError

Rows = Sequence[Sequence[str]]
_Columns = tuple[tuple[str, str], ...]

_BRACKETED = re.compile(r"[\[(](.*)[\])]")
_STEP_LINE = re.compile(r"\[step\]", re.IGNORECASE)
_WORDS_FOR_NAME = (
    "result:", "ergebnis:", "résultat:", "interval and data points:", "intervall und messpunkte:",
    "intervalle et points de données:", "step name", "test:",
)  # fmt: skip
_POINT_OF_SEGMENT = re.compile(r"([0-9]+)\|[0-9]+")
_DATA_POINT = "data point"
_INVALID = re.compile(r"\((invalid|invalide|ungültig)\)", re.IGNORECASE)


@dataclass(frozen=True)
class Block:
    """Lines of numbers under one header.

    Attributes
    ----------
    name
        What the file calls it, or empty.
    columns
        Name and unit of each column; the unit is empty where the file gives none.
    cells
        Text of the rows, with decimal points.
    line
        Line of the file on which the numbers begin.
    constants
        What the lines above say of the whole block, such as the gap or the rate.
    above
        Those lines: of the file's head, and since the block before, the nearest last.
    """

    name: str
    columns: tuple[tuple[str, str], ...]
    cells: tuple[tuple[str, ...], ...]
    line: int
    constants: tuple[Constant, ...] = ()
    above: tuple[tuple[str, ...], ...] = ()

    @classmethod
    def of(cls, columns: Mapping[str, tuple[str, ArrayLike]], name: str = "") -> "Block":
        """Return columns of numbers as a block, as if a file had held them as text.

        Parameters
        ----------
        columns
            Unit, empty for a pure number, and values of each column, by its name. All have the same
            shape (n,); a value that is nan is an empty cell.
        name
            What the file calls the block.

        Raises
        ------
        InputError
            If a column is no list of numbers, or they differ in length.
        """
        values = [np.asarray(numbers, dtype=float) for _, numbers in columns.values()]
        if not values or {one.shape for one in values} != {(values[0].size,)}:
            shapes = ", ".join(f"{n}: {v.shape}" for n, v in zip(columns, values, strict=True))
            raise InputError(
                f"The columns of a block must have one length; got {shapes or 'none'}."
            )
        heads = tuple((str(key), str(unit)) for key, (unit, _) in columns.items())
        rows = np.stack(values, axis=1).tolist()
        cells = tuple(tuple("" if x != x else repr(x) for x in row) for row in rows)
        return cls(name, heads, cells, 1)


def require_blocks(blocks: list[Block], name: str) -> list[Block]:
    """Return the blocks of a file."""
    if not blocks:
        raise InputError(
            f"{name} holds no lines of numbers under a line of names. If it has no names, add "
            "a line such as time_s,shear_rate_1_s,stress_Pa; else say where they are with "
            "--header-row, and check --delimiter."
        )
    return blocks


def blocks_of_rows(rows: Rows, header_row: int | None = None) -> list[Block]:
    """Return the blocks of numbers among the lines of a table.

    Lines that begin with a word are a block of their own for each word, such as the name of an
    action or the number of a segment.

    Parameters
    ----------
    rows
        The cells of each line, numbers with decimal points.
    header_row
        Line of the names, if the line above the numbers is not it; then only the block below.
    """
    blocks: list[Block] = []
    header: _Columns | None = None
    above: list[Sequence[str]] = list(rows[: header_row or 0])
    read, i = 0, header_row or 0
    head: Rows = ()
    while i < len(rows):
        if not _is_numbers(rows[i]):
            above.append(rows[i])
            i += 1
            continue
        end = i
        while end < len(rows) and _is_numbers(rows[end]):
            end += 1
        # numbers after an empty line alone stand under the names of those before
        if any(any(row) for row in rows[read:i]) or not read:
            header = _header(rows, i, header_row)
        if header is not None:
            head = head or rows[:i]
            words = (*head, *rows[read:i]) if read else head
            made = _by_label(rows, i, end, header, constants_of(above))
            blocks += (replace(block, above=tuple(map(tuple, words))) for block in made)
        if header_row is not None and blocks:
            break
        read = i = end
    return blocks


def _by_label(
    rows: Rows, data: int, end: int, header: _Columns, constants: tuple[Constant, ...]
) -> Iterator[Block]:
    """Yield the blocks of consecutive lines of numbers, one for each word in the first column."""
    width = len(header)
    name = _name(rows, data)
    numbered = enumerate(rows[data:end], start=data + 1)
    for label, lines in groupby(numbered, key=lambda pair: _label(pair[1])):
        group = list(lines)
        if label and label != _DATA_POINT and len(group) < 2:
            continue  # a line about the measurement, such as the number of its points
        cells = tuple(
            # what the instrument itself calls invalid is no number
            ("",) * width
            if any(_INVALID.search(cell) for cell in row)
            else tuple((list(row) + [""] * width)[:width])
            for _, row in group
        )
        whole = label if label and label != _DATA_POINT else name
        yield Block(whole, header, cells, group[0][0], constants)


def _label(row: Sequence[str]) -> str:
    """Return the word that a line of numbers begins with; empty if there is none."""
    first = row[0]
    if not first or is_number(first) or _INVALID.search(first):
        return ""
    if first.lower() == _DATA_POINT:
        return _DATA_POINT
    segment = _POINT_OF_SEGMENT.fullmatch(first)
    return f"segment {segment.group(1)}" if segment else first


def _is_numbers(row: Sequence[str]) -> bool:
    """Return whether a row is data: most of it numbers (not a status), after a word or none."""
    filled = [cell for cell in row if cell]
    numbers = [is_number(cell) for cell in filled]
    if len(filled) < 2 or 2 * sum(numbers) <= len(filled):
        return False
    return numbers[0] or (sum(numbers) > 1 and not filled[0].endswith(":"))


def _header(rows: Rows, data: int, header_row: int | None) -> _Columns | None:
    """Return names and units of the columns above the numbers."""
    if header_row is not None:
        names = rows[header_row - 1]
        between = [row for row in rows[header_row:data] if any(row)]
        units = between[0] if between else []
    else:
        above = [row for row in rows[max(0, data - 6) : data] if any(row)]
        if not above or _is_numbers(above[-1]):
            return None
        units = above[-1] if len(above) > 1 and _are_units(above[-1], above[-2]) else []
        names = above[-2] if units else above[-1]
    # a line of names may begin as a comment does
    if names and names[0].startswith(("#", "%")):
        first = names[0].lstrip("#% ")
        names = [first, *names[1:]] if first else names[1:]
    width = max(len(names), len(rows[data]))
    names, units = ([*row, *[""] * (width - len(row))] for row in (names, units))
    columns = [name_and_unit(name, unit) for name, unit in zip(names, units, strict=False)]
    return tuple(columns) if any(name for name, _ in columns) else None


def _are_units(row: Sequence[str], above: Sequence[str]) -> bool:
    filled = [cell for cell in row if cell]
    if all(_BRACKETED.fullmatch(cell) for cell in filled):
        return True
    # short words under longer ones, and names for (nearly) every unit
    names = [cell for cell in above if cell]
    if len(names) < len(filled) or not filled or any(len(cell) > 12 for cell in filled):
        return False
    known = [read_unit(cell) is not None for cell in filled]
    return sum(map(len, filled)) < 0.7 * sum(map(len, names)) or all(known)


def _name(rows: Rows, data: int) -> str:
    """Return what the lines above say that the block is."""
    found: list[str] = []
    for i in range(data - 1, max(-1, data - 12), -1):
        row = rows[i]
        first = row[0] if row else ""
        words = first.lower().startswith(_WORDS_FOR_NAME) and len(row) > 1
        if _is_numbers(row) and not words:
            break
        if _STEP_LINE.fullmatch(first):
            found += [] if found else [cell for cell in rows[i + 1][:1] if cell]
            break
        if words:
            found.append(f"interval {row[1]}" if first.lower().startswith("inter") else row[1])
    return ", ".join(dict.fromkeys(word for word in reversed(found) if word))
