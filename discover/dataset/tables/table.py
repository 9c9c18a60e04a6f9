"""Files that users give: tables and TOML, read safely, with errors that name column and line."""

import csv
import io
import json
import os
import re
import stat
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from discover.dataset.tables.units import Quantity, find_column
from discover.errors import InputError, Problems
from discover.inputs_kept import note_input
from discover.words import did_you_mean, listed, nearest

LARGEST_FILE = 300_000_000  # bytes; some five million samples, more than can be looked at
_AT_ONCE = getattr(os, "O_NONBLOCK", 0)
LARGEST_TEXT = 1_000_000  # bytes of TOML; what is written by hand is a page of text
_MOST_LINES = 6  # faulty lines of a file that a message names
# no rheometer quantity in SI units is larger; squares of such numbers still compute
LARGEST_VALUE = 1e15
# what is nearer to zero is zero: no instrument tells them apart, and its square is no number
SMALLEST_VALUE = 1e-100

_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
_DECIMAL_COMMA = re.compile(r"[+-]?[0-9]+,[0-9]+([eE][+-]?[0-9]+)?")
_IMPORT = "discover data import"


def is_number(cell: str) -> bool:
    """Return whether a cell is a number."""
    return _NUMBER.fullmatch(cell) is not None


@dataclass(frozen=True)
class Table:
    """A CSV file as text."""

    name: str  # for messages
    columns: Mapping[str, Sequence[str]]
    lines: Sequence[int]  # on which each row stands; blank lines count but are no rows

    def __len__(self) -> int:
        return len(self.lines)

    @property
    def listed(self) -> str:
        """Names of the columns, as they can be printed in a message."""
        names = [shown(column) for column in self.columns]
        more = f" and {len(names) - 12} more" if len(names) > 12 else ""
        return ", ".join(names[:12]) + more

    def numbers(self, column: str, factor: float = 1.0) -> Float[np.ndarray, " n"]:
        """Return a column times a factor, what is next to nothing as 0; InputError if no number."""
        text = self.columns[column]
        # as Python reads them: pandas before 3 drops the last of many digits
        values = np.array([float(c) if _NUMBER.fullmatch(c) else np.nan for c in text])
        rows = np.flatnonzero(~np.isfinite(values))
        if rows.size:
            row = int(rows[0])
            raise InputError(
                f"{column} in {self.name} must hold finite numbers; line {self.lines[row]} holds "
                f"{shown(text[row])}. {self._remedy(text[row], row)}{self.like_it(rows)}"
            )
        values = np.where(np.abs(values) < SMALLEST_VALUE, 0.0, values * factor)
        row = int(np.argmax(np.abs(values)))
        if abs(values[row]) > LARGEST_VALUE:
            made = "" if factor == 1.0 else f", which is {values[row]:g} in SI units"
            raise InputError(
                f"{column} in {self.name} holds {shown(text[row])} on line {self.lines[row]}{made}:"
                f" more than any measurement (the limit is {LARGEST_VALUE:g}). Correct that line, "
                "or the unit in the heading."
            )
        return values

    def _remedy(self, cell: str, row: int) -> str:
        if _DECIMAL_COMMA.fullmatch(cell):
            return f"Write decimal points, not commas, or use {_IMPORT}."
        # a row of units has no number in any column
        words = not any(is_number(cells[row]) for cells in self.columns.values())
        if row == 0 and cell and words and not any(c.isdigit() for c in cell.replace("1/", "")):
            return (
                "That looks like a row of units: put them into the header, as in time_s, and "
                f"remove the row, or use {_IMPORT}."
            )
        if is_number(cell):
            return "That is beyond what a computer holds as a number; correct that line."
        return "Correct that line or remove it."

    def like_it(self, rows: Int[np.ndarray, " faulty"]) -> str:
        """Return which lines of the file have the fault of the first of some rows too."""
        return _like_it([self.lines[row] for row in rows])

    def require_positive(self, *quantities: Quantity) -> None:
        """Raise InputError, with all problems, if a column is anywhere zero or less."""
        problems = Problems()
        for quantity in quantities:
            values, found = self.quantity(quantity), find_column(tuple(self.columns), quantity)
            if values is None or found is None or not (rows := np.flatnonzero(values <= 0)).size:
                continue
            row = int(rows[0])
            problems.add(
                f"{found[0]} in {self.name} must be positive; line {self.lines[row]} holds "
                f"{shown(self.columns[found[0]][row])}. Remove that line.{self.like_it(rows)}"
            )
        problems.require_none(self.name)

    def quantity(self, quantity: Quantity) -> Float[np.ndarray, " n"] | None:
        """Return a quantity in SI units, None without a column; InputError if it is wrong."""
        try:
            found = find_column(tuple(self.columns), quantity)
        except InputError as error:
            raise InputError(f"{self.name}: {error}") from error
        return None if found is None else self.numbers(*found)

    def required(self, quantity: Quantity) -> Float[np.ndarray, " n"]:
        """Return a quantity in SI units; InputError if no column holds it, or it is wrong."""
        values = self.quantity(quantity)
        if values is None:
            raise InputError(
                f"{self.name} has no column {quantity.column}; its columns are "
                f"{self.listed}. {_rename(quantity, self.columns)}"
            )
        return values

    def all_required(self, *quantities: Quantity) -> list[Float[np.ndarray, " n"]]:
        """Return several such quantities; if something is wrong, all that is, in one error."""
        problems, found = Problems(), []
        for quantity in quantities:
            with problems.collected():
                found.append(self.required(quantity))
        problems.require_none(self.name)
        return found


def read_bytes(
    path: Path, name: str, if_missing: str = "Check its path.", largest: int = LARGEST_FILE,
    too_large: str = "Keep fewer samples of it.", is_input: bool = True,
) -> bytes:  # fmt: skip
    """Return the content of a regular file of reasonable size; InputError if it is none.

    `largest` in bytes. `is_input`: whether a command that reads it must not write over it.
    """
    try:
        # what was opened is what is asked; opening must not wait for the other end of a pipe
        with open(path, "rb", opener=lambda p, flags: os.open(p, flags | _AT_ONCE)) as file:
            status = os.fstat(file.fileno())
            size = status.st_size
            if not stat.S_ISREG(status.st_mode):
                raise InputError(
                    f"{name} is a pipe or device, not a file. Save the data in a file."
                )
            # a file that grows, or says 0 bytes and never ends, is no larger than the limit either
            content = file.read(size + 1) if size <= largest else b""
            if len(content) > size:
                content += file.read(largest + 1 - len(content))
        size = max(size, len(content))
        if size > largest:
            raise InputError(
                f"{name} has {size / 1e6:.0f} MB; the limit is {largest / 1e6:.0f} MB. {too_large}"
            )
        if is_input:
            note_input(path, status)
        return content
    except InputError:
        raise
    except IsADirectoryError:
        raise InputError(f"{name} is a folder, not a file.{_file_in(path)}") from None
    except (FileNotFoundError, NotADirectoryError):
        folder = path.parent.name
        place = f" in {folder}" if folder and str(path) != name else ""
        raise InputError(
            f"There is no file {name}{place}.{did_you_mean_file(path)} {if_missing}"
        ) from None
    except OSError as error:
        raise InputError(
            f"{name} cannot be read: {error.strerror or error}. Check the file and who may read it."
        ) from None
    except ValueError:
        raise InputError(f"{name!r} is not a valid file name.") from None


def _file_in(folder: Path) -> str:
    """Return which study to name in place of a folder; which file, if it holds none."""
    if studies := sorted(folder.glob("*.toml")):
        return f" Did you mean {str(studies[0])!r}?"
    data = any(folder.glob("*.csv"))
    return " Give a study file (TOML) whose [data] folder it is." if data else " Name a file in it."


def did_you_mean_file(path: Path) -> str:
    """Return a question that names the file or folder spelled most like one that is not there."""
    try:
        there = [entry.name for entry in os.scandir(path.parent)]
    except (OSError, ValueError):  # the folder is not there either, or may not be read
        return did_you_mean_file(path.parent) if path.parent != path.parent.parent else ""
    return did_you_mean(path.name, (name for name in there if not name.startswith(".")))


def read_table(path: Path, name: str | None = None, if_missing: str = "Add it.") -> Table:
    """CSV file with a header line as text; InputError if missing, empty, or no UTF-8 CSV."""
    name = path.name if name is None else name
    text = _decode(read_bytes(path, name, if_missing), name)
    reader = csv.reader(io.StringIO(text, newline=""), skipinitialspace=True, strict=True)
    rows: list[tuple[int, list[str]]] = []  # with the line on which each begins
    before = 0
    try:
        for cells in reader:
            line, before = before + 1, reader.line_num
            if any(cell.strip() for cell in cells):
                rows.append((line, cells))
    except csv.Error as error:
        why = f"line {before + 1} ({error}). Fix the quotes there."
        raise InputError(f"{name} is not a comma-separated table: {why}") from None
    if not rows:
        raise InputError(f"{name} is empty; it must hold a header and rows. Add them.")
    (line, cells), *rows = rows
    header = _header(cells, line, name)
    if not rows:
        raise InputError(f"{name} has a header but no rows. Add the samples, or remove the file.")
    if ragged := [row for row in rows if len(row[1]) != len(header)]:
        line, cells = ragged[0]
        commas = len(cells) > len(header) and all(is_number(cell.strip()) for cell in cells)
        remedy = "Decimal commas look so too: write decimal points."
        raise InputError(
            f"{name} is not a comma-separated table: line {line} has {len(cells)} cells, the "
            f"header {len(header)}. {remedy if commas else 'Correct that line.'}"
            f"{_like_it([line for line, _ in ragged])}"
        )
    columns = {column: [row[i].strip() for _, row in rows] for i, column in enumerate(header)}
    return Table(name, columns, [line for line, _ in rows])


def table_in(root: Path, name: str) -> Table | None:
    """Return a table of a folder; None if it is not there, InputError if a link leads outside."""
    if not os.path.lexists(root / name):
        return None
    if not is_inside(root, name):
        raise InputError(
            f"{name} is a link to outside the folder. Put the file itself in the folder."
        )
    return read_table(root / name)


def is_inside(root: Path, name: str) -> bool:
    """Return whether a file lies in a folder, by its name and where links lead."""
    try:
        return (root / name).resolve().is_relative_to(root.resolve())
    except (OSError, RuntimeError, ValueError):  # too long, or a link to itself
        return False


def _decode(content: bytes, name: str) -> str:
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise InputError(
            f"{name} is in UTF-16, as some instruments export it; UTF-8 is wanted. Save it as CSV "
            f"UTF-8, or use {_IMPORT}."
        )
    if b"\0" in content:
        line = content[: content.index(b"\0")].count(b"\n") + 1
        raise InputError(
            f"{name} is not text: line {line} holds a zero byte, as spreadsheets and other binary "
            "files do. Save it as CSV."
        )
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise InputError(
            f"{name} is not a comma-separated table in UTF-8: line {line} holds the byte "
            f"0x{content[error.start]:02x}. Save it as CSV UTF-8, or use {_IMPORT}."
        ) from None


def _header(cells: list[str], line: int, name: str) -> list[str]:
    columns = [cell.strip() for cell in cells]
    if all(map(is_number, columns)):
        raise InputError(
            f"{name} begins with numbers on line {line}, not with the names of its columns. Add a "
            "header such as time_s,shear_rate_1_s,stress_Pa."
        )
    if len(columns) == 1:
        for mark, word in ((";", "semicolons"), ("\t", "tabs")):
            if mark in columns[0]:
                raise InputError(
                    f"{name} separates its columns by {word} (line {line}), not commas. Save it "
                    f"with commas and decimal points, or use {_IMPORT}."
                )
    for i, column in enumerate(columns):
        if not column:
            raise InputError(f"Column {i + 1} of {name} has no name. Name it or remove it.")
        if columns.index(column) != i:
            raise InputError(f"{name} has two columns named {shown(column)}; keep one.")
    return columns


def _like_it(lines: Sequence[int]) -> str:
    """Return which lines are as faulty as the first of them, as the end of a message."""
    others = [str(line) for line in lines[1:]]
    if len(others) > _MOST_LINES:
        others = [*others[:_MOST_LINES], f"{len(others) - _MOST_LINES} more"]
    return f" (Line{'s' * (len(others) > 1)} {listed(others)} too.)" if others else ""


def _rename(quantity: Quantity, columns: Mapping[str, Sequence[str]]) -> str:
    """Point to the column that was probably meant."""
    stem, wanted = quantity.stem.lower(), quantity.column
    for column in columns:
        plain = column.lower()
        if plain == wanted.lower():
            return f"Names are case-sensitive: rename {column} to {wanted}."
        if plain == stem or re.match(rf"{re.escape(stem)}\W", plain):
            return f"Rename {shown(column)} to {wanted}, if that is its unit."
        if plain.startswith(stem + "_"):
            words = "ends in no unit that is known; rename it to"
            return f"{shown(column)} {words} {wanted}, or put another unit after the underscore."
    near = nearest(wanted, columns)
    remedy = "Add it, or rename the column that holds it."
    return remedy if near is None else f"Is {shown(near)} meant? Then rename it."


def shown(cell: str) -> str:
    """Return a cell as it can be printed: short and without control characters."""
    plain = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in cell.strip())
    return (plain[:40] + "…" if len(plain) > 40 else plain) or "nothing"


def as_column(values: object, label: str) -> Float[np.ndarray, " n"]:
    """Finite plain numbers as an array of shape (n,); InputError where they are none."""
    if hasattr(values, "magnitude"):
        got = type(values).__name__
        raise InputError(f"{label} carries a unit; got a {got}. Give plain numbers in SI units.")
    try:
        given = np.asarray(values)
        # pandas marks what is missing in columns of objects
        numbers = given.astype(float) if given.dtype.kind in "iufO" else None
    except (TypeError, ValueError, OverflowError):
        numbers = None
    if numbers is None or numbers.ndim != 1:
        got = repr(values) if len(repr(values)) <= 60 else f"{repr(values)[:60]}…"
        if shape := getattr(values, "shape", None):
            got = f"an array of shape {shape} of {getattr(values, 'dtype', 'unknown type')}"
        raise InputError(f"{label} must be a list or an array of numbers; got {got}.")
    if not np.all(np.isfinite(numbers)):
        row = int(np.argmin(np.isfinite(numbers)))
        where = f"sample {row} holds {numbers[row]}"
        raise InputError(f"{label} must be finite; {where}. Remove that sample.")
    return numbers


_MOST_DOTS = 5000  # of a line: the library's time grows with the square of the parts of a key


def read_toml(path: Path, kind: str, example: str) -> tuple[dict[str, Any], str]:
    """Content and text of a TOML file of a `kind`; InputError says where, and `example`."""
    raw = read_bytes(
        path, str(path), f"Check the path of the {kind}.", largest=LARGEST_TEXT, too_large=example
    )
    try:
        # editors on Windows write a byte order mark, which TOML does not know
        text = raw.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError:
        raise InputError(
            f"{path} is not UTF-8 text, so it is not a {kind}. Save it as UTF-8."
        ) from None
    for number, line in enumerate(text.split("\n"), start=1):
        if line.count(".") > _MOST_DOTS:
            raise InputError(
                f"{path} has more than {_MOST_DOTS} dots on line {number}, so it is not a {kind}. "
                f"{example}"
            )
    try:
        return tomllib.loads(text), text
    except RecursionError:
        raise InputError(f"{path} is nested too deeply to be a {kind}. {example}") from None
    except ValueError as error:  # TOML's own error, or a number of thousands of digits
        raise InputError(f"{path} is not valid TOML: {error}. Correct that line.") from None


def toml_string(text: str) -> str:
    """Return a text as TOML has it, which escapes as JSON does, and DEL besides."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
