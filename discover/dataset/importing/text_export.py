"""Blocks of numbers in a table of cells, with the names, the units and the words above them.

Plain tables, TRIOS (``[step]``), RheoCompass (``Interval data:``), rSpace and RheoWin all are a
line of names, perhaps of units, then lines of numbers, some of which begin with a word.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from discover.dataset.importing.names import alternatives
from discover.dataset.importing.text_rows import (
    MOST_CELLS,
    Constant,
    constants_of,
    is_clock,
    is_number,
)
from discover.dataset.tables.units import name_and_unit, read_unit
from discover.errors import InputError

Rows = Sequence[Sequence[str]]
_Columns = tuple[tuple[str, str], ...]

_BRACKETED = re.compile(r"[\[(](.*)[\])]")
_STEP_LINE = re.compile(r"\[step\]", re.IGNORECASE)
_POINT_OF_SEGMENT = re.compile(r"([0-9]+)\|[0-9]+")
# a line of one cell that is neither a name with its value nor a number
_TITLE = re.compile(r"[^:=;]*[^\W\d_]{3}[^:=;]*")
_DATA_POINT = "data point"
_FEWEST = 3

_LINES = alternatives("lines")
_BEFORE_NAME = re.compile(_LINES["lines_of_a_name"], re.IGNORECASE)
OF_TESTS = re.compile(
    rf"((?P<sample>{_LINES['samples']})|{_LINES['steps']})s?"
    r"( (name|id|no|nr|number|index|label))?#?"
)
"""Names of columns that say which sample or step a row is of, as `plain_words` gives them."""
_INVALID = re.compile(r"\((invalid|invalide|ungültig)\)", re.IGNORECASE)


@dataclass(frozen=True)
class Block:
    """Lines of numbers under one header."""

    name: str  # what the file calls it, or empty
    columns: tuple[tuple[str, str], ...]  # name and unit of each; empty where the file has none
    cells: tuple[tuple[str, ...], ...]  # text of the rows, with decimal points
    line: int  # of the file, on which the numbers begin
    constants: tuple[Constant, ...] = ()  # what the lines above say of all of it, such as the gap
    over: tuple[str, ...] = ()  # what stands above the name of a column, or of one left of it
    apart: bool = False  # whether what stands before it is another sample, or temperature
    told_by: tuple[str, ...] = ()  # columns that tell it from the other tests of one table
    above: tuple[tuple[str, ...], ...] = ()  # the file's head, and lines since the block before

    @classmethod
    def of(cls, columns: Mapping[str, tuple[str, ArrayLike]], name: str = "") -> "Block":
        """Return columns of numbers as a block, as if a file had held them as text.

        `columns`: unit, empty for a pure number, and values of each by its name, all of one shape
        (n,); nan is an empty cell. Raises InputError if they are none.
        """
        values = [np.asarray(numbers, dtype=float) for _, numbers in columns.values()]
        if not values or {one.shape for one in values} != {(values[0].size,)}:
            shapes = ", ".join(f"{n}: {v.shape}" for n, v in zip(columns, values, strict=True))
            raise InputError(
                f"The columns of a block must have one length; got {shapes or 'none'}."
            )
        heads = tuple((str(key), str(unit) or "-") for key, (unit, _) in columns.items())
        rows = np.stack(values, axis=1).tolist()
        cells = tuple(tuple("" if x != x else repr(x) for x in row) for row in rows)
        return cls(name, heads, cells, 1)

    @cached_property
    def numbers(self) -> Float[np.ndarray, "columns n"]:
        """The cells as numbers, nan where one is none; read once."""
        rows = [[float(c) if is_number(c) else np.nan for c in row] for row in self.cells]
        return np.array(rows, dtype=float).reshape(len(rows), len(self.columns)).T

    @cached_property
    def filled(self) -> tuple[int, ...]:
        """The columns that hold a number."""
        return tuple(np.flatnonzero(~np.isnan(self.numbers).all(axis=1)).tolist())

    def rows(self, chosen: Sequence[int] | np.ndarray) -> "Block":
        """Return the block of some rows, with what is read of them already."""
        kept = [int(i) for i in chosen]
        line = self.line + (kept[0] if kept else 0)
        part = replace(self, cells=tuple(self.cells[i] for i in kept), line=line)
        part.__dict__["numbers"] = self.numbers[:, kept]
        return part


def plain_words(name: str) -> str:
    """Return the words of a name in small letters, without signs between them."""
    return re.sub(r"[\s._]+", " ", name).strip().lower()


def require_blocks(blocks: list[Block], name: str) -> list[Block]:
    """Return the blocks of a file, of which one at least has names."""
    if not any(name for block in blocks for name, _ in block.columns):
        raise InputError(
            f"{name} holds no lines of numbers under a line of names. If it has no names, add "
            "a line such as time_s,shear_rate_1_s,stress_Pa; else say where they are with "
            "--header-row, and check --delimiter."
        )
    return blocks


def blocks_of_rows(rows: Rows, header_row: int | None = None) -> list[Block]:
    """Return blocks of numbers among cells of lines; one below `header_row`, the line of names."""
    blocks: list[Block] = []
    header: _Columns | None = None
    over: tuple[str, ...] = ()
    read, i = 0, header_row or 0
    above: list[Sequence[str]] = list(rows[:i])
    head: Rows = ()
    while i < len(rows):
        if not _is_numbers(rows[i]):
            above.append(rows[i])
            i += 1
            continue
        end = next((k for k in range(i, len(rows)) if not _is_numbers(rows[k])), len(rows))
        # numbers after an empty line alone stand under the names of those before
        if any(any(row) for row in rows[read:i]) or not read:
            header, over = _header(rows, i, header_row)
        if header is not None:
            head = head or rows[:i]
            words = (*head, *rows[read:i]) if read else head
            made = _by_label(rows, i, end, header, constants_of(above))
            blocks += (replace(block, over=over, above=tuple(map(tuple, words))) for block in made)
        elif end - i >= _FEWEST:  # without names: to be left out with a word
            width = max(map(len, rows[i:end]))
            blocks.append(Block("", (("", ""),) * width, _padded(rows[i:end], width), i + 1))
        if header_row is not None and blocks:
            break
        read = i = end
    return blocks


def _by_label(
    rows: Rows, data: int, end: int, header: _Columns, constants: tuple[Constant, ...]
) -> Iterator[Block]:
    """Yield the blocks of consecutive lines of numbers, one for each word in the first column."""
    width = len(header)
    if width * (end - data) > MOST_CELLS:
        raise InputError(
            f"The table from line {data + 1} on has {width} columns and {end - data} rows; the "
            f"limit is {MOST_CELLS} cells. Keep the columns and rows of the measurement."
        )
    numbered = list(enumerate(rows[data:end], start=data + 1))
    groups = [(label, list(lines)) for label, lines in groupby(numbered, lambda p: _label(p[1]))]
    alone = sum(bool(label) and len(lines) < 2 for label, lines in groups)
    # a column of words or of the time of day; or one that splits as any such column does
    is_column = alone > 2 and 2 * alone > len(groups)
    splits = OF_TESTS.fullmatch(plain_words(header[0][0]))
    if is_column or (splits and not _POINT_OF_SEGMENT.fullmatch(rows[data][0])):
        groups = [("", numbered)]
    name = _name(rows, data)
    for label, lines in groups:
        own = "" if label == _DATA_POINT else label
        if own and len(lines) < 2:
            continue  # a line about the measurement, such as the number of its points
        # what the instrument itself calls invalid is no number
        valid = [[] if any(map(_INVALID.search, row)) else row for _, row in lines]
        yield Block(own or name, header, _padded(valid, width), lines[0][0], constants)


def _padded(rows: Rows, width: int) -> tuple[tuple[str, ...], ...]:
    return tuple(tuple((list(row) + [""] * width)[:width]) for row in rows)


def _label(row: Sequence[str]) -> str:
    """Return the word that a line of numbers begins with; empty if there is none."""
    first = row[0]
    if not first or is_number(first) or is_clock(first) or _INVALID.search(first):
        return ""
    if first.lower() == _DATA_POINT:
        return _DATA_POINT
    segment = _POINT_OF_SEGMENT.fullmatch(first)
    return f"segment {segment.group(1)}" if segment else first


def _is_numbers(row: Sequence[str]) -> bool:
    """Return whether a row is data: most of it numbers (not a status), after a word or none."""
    filled = [cell for cell in row if cell]
    numbers = [is_number(cell) or is_clock(cell) for cell in filled]
    if not any(map(is_number, filled)) or len(filled) < 2 or 2 * sum(numbers) <= len(filled):
        return False
    return numbers[0] or (sum(numbers) > 1 and not filled[0].endswith(":"))


def _header(
    rows: Rows, data: int, header_row: int | None
) -> tuple[_Columns | None, tuple[str, ...]]:
    """Return names and units of the columns above the numbers, and what stands above the names."""
    units: Sequence[str] = []
    if header_row is not None:
        at = header_row - 1
        units = next((row for row in rows[header_row:data] if any(row)), units)
    else:
        above = [i for i in range(max(0, data - 6), data) if any(rows[i])]
        if not above or _is_numbers(rows[above[-1]]):
            return None, ()
        at = above[-1]
        if len(above) > 1 and _are_units(rows[at], rows[above[-2]]):
            at, units = above[-2], rows[at]
    names = list(rows[at])
    # a line of names may begin as a comment does
    if names and names[0].startswith(("#", "%")):
        first = names[0].lstrip("#% ")
        names = [first, *names[1:]] if first else names[1:]
    width = max(len(names), len(rows[data]))
    names, units = ([*row, *[""] * (width - len(row))] for row in (names, units))
    columns = [name_and_unit(name, unit) for name, unit in zip(names, units, strict=False)]
    if not any(name for name, _ in columns):
        return None, ()
    # what the lines above the names say of each column, a cell holding for those after
    labels = [""] * width
    for row in rows[max(0, at - 2) : at]:
        cell = ""
        for i in range(width) if sum(map(bool, row)) > 1 else ():
            cell = (row[i] if i < len(row) else "") or cell
            labels[i] = ", ".join(filter(None, (labels[i], cell)))
    return tuple(columns), tuple(labels)


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
    """Return what the lines above say that the block is, or else the title of its section."""
    found: list[str] = []
    title = ""
    for i in range(data - 1, max(-1, data - 12), -1):
        row = rows[i]
        first = row[0] if row else ""
        words = _BEFORE_NAME.match(first) is not None and len(row) > 1
        if _is_numbers(row) and not words:
            break
        if _STEP_LINE.fullmatch(first):
            found += [] if found else [cell for cell in rows[i + 1][:1] if cell]
            break
        if words:
            found.append(f"interval {row[1]}" if first.lower().startswith("inter") else row[1])
        elif not title and sum(map(bool, row)) == 1 and _TITLE.fullmatch("".join(row)):
            title = "".join(row).strip("-=*#_~<>[]| ")
    return ", ".join(dict.fromkeys(word for word in reversed(found) if word)) or title
