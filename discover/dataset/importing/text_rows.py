"""Cells of text: encoding, delimiter, decimal sign, clocks, and what lines above a block say."""

import codecs
import csv
import io
import re
import unicodedata
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float

from discover.dataset.importing.names import code_page_of
from discover.dataset.tables.table import is_number, read_bytes
from discover.dataset.tables.units import name_and_unit
from discover.errors import InputError

Decimal = Literal[".", ","]

_DATE = (
    r"(?:(?P<year>\d{4})[-/.](?P<month>\d{1,2})[-/.](?P<day>\d{1,2})"
    r"|(?P<first>\d{1,2})(?P<mark>[-/.])(?P<second>\d{1,2})(?P=mark)(?P<last>\d{4}|\d{2}))[T ,]+"
)
_CLOCK = re.compile(
    rf"(?:{_DATE}|(?P<days>\d{{1,5}})(?:\.| ?d(?:ays?)?,? +))?"
    r"(?:(?P<hours>\d{1,4}):)?(?P<minutes>\d{1,4}):(?P<seconds>\d{1,2}(?:[.,]\d*)?)"
    r"\s*(?P<half>[AaPp]\.?[Mm]\.?)?\s*(?:Z|[+-]\d{2}:?\d{2})?"
)
_DAY = 86400.0


def is_clock(cell: str) -> bool:
    """Return whether a cell is a clock's reading, a duration with colons or a time stamp."""
    return ":" in cell and _CLOCK.fullmatch(cell) is not None


def seconds(cells: Sequence[str], unit: str = "") -> Float[np.ndarray, " n"]:
    """Return readings of a clock in s, counted on past midnight; `unit` such as ``hh:mm``."""
    matches = [_CLOCK.fullmatch(cell) if ":" in cell else None for cell in cells]
    # 5/1 is the fifth of January unless some second number is no month; with slashes, AM and PM it
    # is the first of May
    dated = [m for m in matches if m and m["second"]]
    american = any(m["half"] and m["mark"] == "/" for m in dated)
    american = american and all(int(m["first"]) <= 12 for m in dated)
    american = american or any(int(m["second"]) > 12 for m in dated)
    in_hours = re.fullmatch(r"h+\W?m+(?:in)?", unit.strip().lower()) is not None
    values = np.array([_reading(m, american, in_hours) for m in matches])
    known = np.isfinite(values)
    if not known.any():
        return values
    clock = values[known]
    # a day goes by where a clock without a date falls back by more than half of one
    clock = clock + _DAY * np.cumsum(np.diff(clock, prepend=clock[0]) < -0.5 * _DAY)
    if any(m and (m["year"] or m["last"]) for m in matches) or clock[0] > max(np.ptp(clock), 60.0):
        clock = clock - clock[0]
    values[known] = clock
    return values


def _reading(match: re.Match | None, american: bool, in_hours: bool) -> float:
    if match is None:
        return np.nan
    parts = ("hours", "minutes", "seconds")
    hours, minutes, rest = (float((match[key] or "0").replace(",", ".")) for key in parts)
    if in_hours and match["hours"] is None:
        hours, minutes, rest = minutes, rest, 0.0
    if match["half"]:
        hours = hours % 12 + 12.0 * (match["half"][0] in "Pp")
    time = 3600.0 * hours + 60.0 * minutes + rest + _DAY * int(match["days"] or 0)
    if match["year"]:
        date = match.group("year", "month", "day")
    elif match["last"]:
        year = match["last"] if len(match["last"]) > 2 else f"20{match['last']}"
        date = year, *match.group(*(("first", "second") if american else ("second", "first")))
    else:
        return time
    try:
        return datetime(*map(int, date), tzinfo=UTC).timestamp() + time
    except ValueError:  # no such day
        return np.nan


DELIMITERS = {"tab": "\t", "semicolon": ";", "comma": ",", "space": " "}
LARGEST_EXPORT = 100_000_000  # bytes as text, of a spreadsheet when it is unpacked
MOST_CELLS = 10_000_000  # more take gigabytes, and hundreds of samples are enough for a test
_FEWER = "Export fewer samples, or one test a file."

_POINT = re.compile(r"[+-]?[0-9]+\.[0-9]+([eE][+-]?[0-9]+)?")
_COMMA = re.compile(r"[+-]?[0-9]*,[0-9]+([eE][+-]?[0-9]+)?")


def read_rows(
    path: Path,
    delimiter: str | None = None,
    decimal: Decimal | None = None,
    encoding: str | None = None,
) -> list[list[str]]:
    """Cells of the lines of a text file; InputError if unreadable, or a comma is ambiguous."""
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
    return with_points(rows, path.name, "." if mark == "," else decimal)


def with_points(
    rows: list[list[str]], name: str, decimal: Decimal | None = None
) -> list[list[str]]:
    """Return rows of stripped cells, numbers with decimal points; InputError on 1,234 alone."""
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


# encodings of Python in which no instrument writes a file
_NO_TEXT = {"idna", "punycode", "undefined", "unicode_escape", "raw_unicode_escape", "utf_7"}


def _decode(content: bytes, name: str, encoding: str | None) -> str:
    if encoding is None:
        marked = content[:2] in (b"\xff\xfe", b"\xfe\xff")
        in_pairs = "utf-16-le" if content[1:2] == b"\0" else "utf-8-sig"
        encoding = "utf-16" if marked else in_pairs
    try:
        known = codecs.lookup(encoding).name.replace("-", "_") not in _NO_TEXT
        "0".encode(encoding)  # some are no encodings of text
    except (LookupError, ValueError):
        known = False
    if not known:
        raise InputError(
            f"There is no encoding {encoding[:60]!r} of text; try utf-8, utf-16 or cp1252."
        )
    try:
        text = content.decode(encoding)
    except UnicodeError:
        if encoding != "utf-8-sig":
            raise InputError(f"{name} is not text in {encoding}. Try another --encoding.") from None
        # instruments on Windows write µ, ° and · so; and the letters of the country
        text = content.decode(code_page_of(content), "replace")
    if "\0" in text:
        raise InputError(f"{name} is not text. Export it as text or CSV from the rheometer.")
    return text


def _delimiter(lines: list[str]) -> str:
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


_VALUE = r"([+-]?(?:[0-9]+[.,]?[0-9]*|[.,][0-9]+)(?:[eE][+-]?[0-9]+)?)\s*((?:1/|[^\s0-9:]).{0,19})?"
_ALONE = re.compile(_VALUE)
_UNIT = re.compile(
    r"[#%\s]*([^:=#%]{1,40}?)[\s_]+(?:units?|einheit|unité)\s*[:=]\s*(\S.{0,19})", re.I
)
_WITH_KEY = re.compile(rf"[#%\s]*([^:=#%]{{1,40}}?)\s*[:=]\s*{_VALUE}")


class Constant(NamedTuple):
    """A number that holds for a whole block."""

    name: str  # as the file writes it
    value: str  # with a decimal point; empty where the line gives a unit alone: "Rate Unit: 1/s"
    unit: str  # empty where the file gives none


def constants_of(rows: Sequence[Sequence[str]]) -> tuple[Constant, ...]:
    """Return what lines say as a name, a number and a unit; the last of a name counts."""
    found: dict[tuple[str, bool], Constant] = {}
    for row in rows:
        for constant in _constants([cell for cell in row if cell]):
            if constant.name[:1].isalpha():
                found[constant.name.lower(), bool(constant.value)] = constant
    return tuple(found.values())


def _constants(cells: Sequence[str]) -> Iterator[Constant]:
    if not 1 <= len(cells) <= 8:
        return
    value = _ALONE.fullmatch(" ".join(cells[1:3])) if len(cells) <= 3 else None
    parts = [] if value else [part.strip() for part in " ".join(cells).split(";")]
    said = [(cells[0], value[1], value[2])] if value else []
    for part in parts:
        if unit := _UNIT.fullmatch(part):
            yield Constant(unit[1], "", unit[2])
        elif match := _WITH_KEY.fullmatch(part):
            said.append((match[1], match[2], match[3]))
    for name, number, unit in said:
        name, unit = name_and_unit(name.strip(" :=#%"), (unit or "").strip())
        yield Constant(name, number.replace(",", "."), unit)


_DEGREES = re.compile(
    r"(?:(?<![^\s_=(\[,;@])-)?(?<![\w.,])([0-9]+(?:[.,][0-9]+)?)\s*_?"
    r"(?:°|º|˚|deg(?:rees?)?[\s_]*)?\s*([CcK]|celsius|kelvin)(?![^\W_])"
)
_AS_SYMBOL = re.compile(
    r"(?<![^\W_])T(?:emp(?:erature)?)?\s*=\s*(-?[0-9]+(?:[.,][0-9]+)?)(?![\w.,%°])"
)
_TO = re.compile(r"[0-9]\s*(?:°?\s*C)?\s*(?:to|bis|à|-|–|\.\.)\s*$")
_KELVIN_FROM = 200.0  # K; below it a melt or a solution is frozen


def temperature_in(text: str) -> Constant | None:
    """Temperature that a title or file name says, in K only near a melt's; None if several."""
    found = set()
    text = text.replace("_", " ")
    for match in _DEGREES.finditer(text):
        value, unit = match[1].replace(",", "."), "°C" if match[2][0].upper() == "C" else "K"
        if _TO.search(text[: match.start()]):
            return None  # a ramp
        if unit == "°C" or _KELVIN_FROM <= float(value) <= 700.0:
            sign = "-" if match[0].startswith("-") else ""
            found.add(Constant("temperature", sign + value, unit))
    if not found and (match := _AS_SYMBOL.search(text)):
        value = match[1].replace(",", ".")
        if abs(float(value)) < _KELVIN_FROM:  # from there on it may be in kelvin
            return Constant("temperature", value, "°C")
    return found.pop() if len(found) == 1 else None
