"""Blocks of numbers in a text export, with the names and units above them.

One reader serves plain CSV, TRIOS ("Export to LIMS", blocks headed ``[step]``) and RheoCompass
(blocks headed ``Interval data:``), since all are the same thing: a line of names, perhaps a line of
units, then lines of numbers. What a block is called is read from the lines above it. The reader of
hermes-rheo was considered for TRIOS: its version 2.0.0 pins older scipy, pandas and matplotlib
than are used here and brings piblin, mastercurves, openpyxl and numdifftools along, for a format of
four lines; it does not read RheoCompass, and TRIOS' other text export neither.
"""

import codecs
import csv
import io
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from discover.dataset.table import read_bytes
from discover.errors import InputError

Decimal = Literal[".", ","]

DELIMITERS = {"tab": "\t", "semicolon": ";", "comma": ","}

_BRACKETED = re.compile(r"[\[(](.*)[\])]")
_STEP_LINE = re.compile(r"\[step\]", re.IGNORECASE)
_WORDS_FOR_NAME = ("result:", "interval and data points:", "step name", "test:")


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
    """

    name: str
    columns: tuple[tuple[str, str], ...]
    cells: tuple[tuple[str, ...], ...]
    line: int

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


def read_blocks(
    path: Path,
    delimiter: str | None = None,
    decimal: Decimal | None = None,
    header_row: int | None = None,
    encoding: str | None = None,
) -> list[Block]:
    """Return the blocks of numbers in a text file.

    Parameters
    ----------
    path
        The file.
    delimiter
        Name from `DELIMITERS`; found from the file if None.
    decimal
        Decimal sign; found from the file if None.
    header_row
        Line of the names, if the line above the numbers is not it; then only the block below.
    encoding
        Of the text; found from the file if None.

    Raises
    ------
    InputError
        If the file cannot be read, holds no numbers under names, or its decimal sign cannot be told
        from its thousands separator.
    """
    text = _decode(read_bytes(path, path.name), path.name, encoding)
    lines = text.splitlines()
    mark = DELIMITERS[delimiter] if delimiter else _delimiter(lines)
    try:
        rows = [next(csv.reader(io.StringIO(line), delimiter=mark), []) for line in lines]
    except csv.Error as error:
        raise InputError(
            f"{path.name} cannot be split into columns ({error}). Give the text export of a "
            "rheometer, and check --delimiter."
        ) from None
    rows = [[cell.strip() for cell in row] for row in rows]
    sign: Decimal = decimal or _decimal(rows, mark, path.name)
    if sign == ",":
        rows = [[_with_point(cell) for cell in row] for row in rows]
    blocks, i = [], 0 if header_row is None else header_row
    while i < len(rows):
        if not _is_numbers(rows[i]):
            i += 1
            continue
        end = i
        while end < len(rows) and _is_numbers(rows[end]):
            end += 1
        header = _header(rows, i, header_row)
        if header is not None:
            width = len(header)
            cells = tuple(tuple((row + [""] * width)[:width]) for row in rows[i:end])
            blocks.append(Block(_name(rows, i), header, cells, i + 1))
        if header_row is not None and blocks:
            break
        i = end
    if not blocks:
        raise InputError(
            f"{path.name} holds no lines of numbers under a line of names. If it has no names, add "
            "a line such as time_s,shear_rate_1_s,stress_Pa; else say where they are with "
            "--header-row, and check --delimiter."
        )
    return blocks


def _decode(content: bytes, name: str, encoding: str | None) -> str:
    if encoding is None:
        if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
            encoding = "utf-16"
        elif content[1:2] == b"\0":
            encoding = "utf-16-le"
        else:
            encoding = "utf-8-sig"
    if not _is_encoding(encoding):
        raise InputError(
            f"There is no encoding {encoding[:60]!r} of text; try utf-8, utf-16 or cp1252."
        )
    try:
        text = content.decode(encoding)
    except UnicodeError:
        # instruments on Windows write µ, ° and · so; every byte has a meaning in latin-1
        text = content.decode("cp1252", "replace") if encoding == "utf-8-sig" else None
    if text is None:
        raise InputError(f"{name} is not text in {encoding}. Try another --encoding.")
    if "\0" in text:
        raise InputError(f"{name} is not text. Export it as text or CSV from the rheometer.")
    return text


_NO_TEXT = ("idna", "punycode", "undefined", "unicode_escape", "raw_unicode_escape", "utf-7")
"""Encodings of Python in which no instrument writes a file."""


def _is_encoding(name: str) -> bool:
    try:
        known = codecs.lookup(name).name
        "0".encode(name)  # some are no encodings of text
    except (LookupError, ValueError):
        return False
    return known.replace("-", "_") not in {other.replace("-", "_") for other in _NO_TEXT}


def _delimiter(lines: list[str]) -> str:
    """Return the sign that splits most lines; a comma only if nothing better does."""
    for mark in ("\t", ";"):
        if sum(mark in line for line in lines) > 0.3 * len([x for x in lines if x.strip()]):
            return mark
    return ","


def _decimal(rows: list[list[str]], mark: str, name: str) -> Decimal:
    if mark == ",":
        return "."
    cells = [cell for row in rows for cell in row]
    if any(re.fullmatch(r"[+-]?[0-9]+\.[0-9]+([eE][+-]?[0-9]+)?", cell) for cell in cells):
        return "."
    commas = [cell for cell in cells if re.fullmatch(r"[+-]?[0-9]+,[0-9]+([eE][+-]?[0-9]+)?", cell)]
    if commas and all(re.fullmatch(r"[+-]?[1-9][0-9]{0,2},[0-9]{3}", cell) for cell in commas):
        raise InputError(
            f"{name} writes numbers such as {commas[0]}: a decimal comma or thousands? Say "
            "--decimal , or --decimal . to decide."
        )
    return "," if commas else "."


def _with_point(cell: str) -> str:
    if re.fullmatch(r"[+-]?[0-9]*,[0-9]+([eE][+-]?[0-9]+)?", cell):
        return cell.replace(",", ".")
    return cell


def is_number(cell: str) -> bool:
    """Return whether a cell is a number."""
    return bool(re.fullmatch(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?", cell))


def _is_numbers(row: list[str]) -> bool:
    """Return whether a row is data: its first cell a number, and most others (not a status)."""
    filled = [cell for cell in row if cell]
    numbers = [is_number(cell) for cell in filled]
    return len(filled) >= 2 and numbers[0] and 2 * sum(numbers) > len(filled)


def _header(
    rows: list[list[str]], data: int, header_row: int | None
) -> tuple[tuple[str, str], ...] | None:
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
    width = max(len(names), len(rows[data]))
    names, units = (row + [""] * (width - len(row)) for row in (names, units))
    columns = [_name_and_unit(name, unit) for name, unit in zip(names, units, strict=False)]
    return tuple(columns) if any(name for name, _ in columns) else None


def _are_units(row: list[str], above: list[str]) -> bool:
    filled = [cell for cell in row if cell]
    if all(_BRACKETED.fullmatch(cell) for cell in filled):
        return True
    # short words under longer ones, and names for (nearly) every unit
    names = [cell for cell in above if cell]
    return len(names) >= len(filled) >= 1 and all(len(cell) <= 12 for cell in filled) and (
        sum(map(len, filled)) < 0.7 * sum(map(len, names))
    )  # fmt: skip


def _name_and_unit(name: str, unit: str) -> tuple[str, str]:
    bracket = _BRACKETED.fullmatch(unit)
    unit = bracket.group(1) if bracket else unit
    inside = re.search(r"\s*[\[(]([^\[\]()]*)[\])]\s*$", name)
    if inside and not unit:
        return name[: inside.start()].strip(), inside.group(1).strip()
    return name, unit.strip()


def _name(rows: list[list[str]], data: int) -> str:
    """Return what the lines above say that the block is."""
    found: list[str] = []
    for i in range(data - 1, max(-1, data - 12), -1):
        row = rows[i]
        if _is_numbers(row):
            break
        first = row[0] if row else ""
        if _STEP_LINE.fullmatch(first) and i + 1 < data:
            found.append(rows[i + 1][0] if rows[i + 1] else "")
            break
        if first.lower().startswith(_WORDS_FOR_NAME) and len(row) > 1:
            found.append(f"interval {row[1]}" if first.lower().startswith("interval") else row[1])
    return ", ".join(dict.fromkeys(word for word in reversed(found) if word))
