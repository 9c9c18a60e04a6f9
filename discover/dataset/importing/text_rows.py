"""Rows of cells in a text file: its encoding, its delimiter and its decimal sign."""

import codecs
import csv
import io
import re
import unicodedata
from pathlib import Path
from typing import Literal

from discover.dataset.importing.clock_times import is_clock
from discover.dataset.importing.names import code_page_of
from discover.dataset.tables.table import read_bytes
from discover.errors import InputError

Decimal = Literal[".", ","]

DELIMITERS = {"tab": "\t", "semicolon": ";", "comma": ",", "space": " "}

LARGEST_EXPORT = 100_000_000
"""Bytes of an export as text, of a spreadsheet's when it is unpacked."""

MOST_CELLS = 10_000_000
"""Cells of a table; more take gigabytes, and hundreds of samples are enough for a test."""

_POINT = re.compile(r"[+-]?[0-9]+\.[0-9]+([eE][+-]?[0-9]+)?")
_COMMA = re.compile(r"[+-]?[0-9]*,[0-9]+([eE][+-]?[0-9]+)?")
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")


_FEWER = "Export fewer samples, or one test a file."


def is_number(cell: str) -> bool:
    """Return whether a cell is a number."""
    return _NUMBER.fullmatch(cell) is not None


def read_rows(
    path: Path,
    delimiter: str | None = None,
    decimal: Decimal | None = None,
    encoding: str | None = None,
) -> list[list[str]]:
    """Return the cells of every line of a text file, numbers with decimal points.

    `delimiter`: name from `DELIMITERS`; found from the file if None. `decimal`: decimal sign; found
    from the file if None. `encoding`: of the text; found from the file if None. Raises InputError
    if the file cannot be read, or its decimal sign cannot be told from its thousands separator.
    """
    content = read_bytes(path, path.name, largest=LARGEST_EXPORT, too_large=_FEWER)
    lines = _decode(content, path.name, encoding).splitlines()
    mark = DELIMITERS[delimiter] if delimiter else _delimiter(lines)
    cells = len(lines) + sum(
        len(line.split()) if mark == " " else line.count(mark) for line in lines
    )
    if cells > MOST_CELLS:
        raise InputError(f"{path.name} has {cells} cells; the limit is {MOST_CELLS}. {_FEWER}")
    try:
        rows = [
            # runs of spaces are one delimiter
            line.split() if mark == " " else next(csv.reader(io.StringIO(line), delimiter=mark), [])
            for line in lines
        ]
    except csv.Error as error:
        raise InputError(
            f"{path.name} cannot be split into columns ({error}). Give the text export of a "
            "rheometer, and check --delimiter."
        ) from None
    if mark == ",":
        decimal = "."
    return with_points(rows, path.name, decimal)


def with_points(
    rows: list[list[str]], name: str, decimal: Decimal | None = None
) -> list[list[str]]:
    """Return rows of cells without spaces around them, numbers with decimal points.

    `rows`: the cells of each line. `name`: of the file, for messages. `decimal`: decimal sign;
    found from the cells if None. Raises InputError if the decimal sign cannot be told from the
    thousands separator.
    """
    rows = [[_tidy(cell.strip()) for cell in row] for row in rows]
    sign = decimal or _decimal(rows, name)
    thousands = "," if sign == "." else "."
    grouped = re.compile(rf"[+-]?[1-9][0-9]{{0,2}}(?:[{thousands}][0-9]{{3}})+(?:[{sign}][0-9]+)?")

    def pointed(cell: str) -> str:
        if grouped.fullmatch(cell):
            cell = cell.replace(thousands, "")
        return cell.replace(",", ".") if sign == "," and _COMMA.fullmatch(cell) else cell

    return [[pointed(cell) for cell in row] for row in rows]


def _tidy(cell: str) -> str:
    """Return a number without spaces and apostrophes between thousands and with a plain minus."""
    if len(cell) > 40 or not any(c.isdigit() for c in cell):
        return cell
    plain = unicodedata.normalize("NFKC", cell).replace("\u2212", "-").replace("’", "'")
    if re.fullmatch(r"[+-]?[0-9]{1,3}(?:[ '][0-9]{3})+(?:[.,][0-9]+)?", plain):
        plain = re.sub("[ ']", "", plain)
    return plain if is_number(plain) or _COMMA.fullmatch(plain) else cell


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
        # instruments on Windows write µ, ° and · so; and the letters of the country
        known = encoding == "utf-8-sig"
        text = content.decode(code_page_of(content), "replace") if known else None
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
    filled = [line for line in lines if line.strip()]
    for mark in ("\t", ";"):
        if sum(mark in line for line in filled) > 0.3 * len(filled):
            return mark
    apart = [[cell.replace(",", ".", 1) for cell in line.split()] for line in filled]
    numbers = sum(
        len(cells) > 1 and all(is_number(c) or is_clock(c) for c in cells) for cells in apart
    )
    return " " if numbers > 0.5 * len(filled) else ","


def _decimal(rows: list[list[str]], name: str) -> Decimal:
    cells = [cell for row in rows for cell in row]
    if any(re.fullmatch(r"[+-]?[0-9]{1,3}(?:\.[0-9]{3})+,[0-9]+", cell) for cell in cells):
        return ","
    if any(re.fullmatch(r"[+-]?[0-9]{1,3}(?:,[0-9]{3})+\.[0-9]+", cell) for cell in cells):
        return "."
    points = sum(_POINT.fullmatch(cell) is not None for cell in cells)
    commas = [cell for cell in cells if "," in cell and _COMMA.fullmatch(cell)]
    grouped = all(re.fullmatch(r"[+-]?[1-9][0-9]{0,2},[0-9]{3}", cell) for cell in commas)
    # a version or a date of the header has a point in any country
    if not commas or points > len(commas) or (points and grouped):
        return "."
    if grouped:
        raise InputError(
            f"{name} writes numbers such as {commas[0]}: a decimal comma or thousands? Say "
            "--decimal , or --decimal . to decide."
        )
    return ","
