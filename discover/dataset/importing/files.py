"""Readers of files that are no plain table: spreadsheets, RepTate's, a user's own."""

import contextlib
import io
import re
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from discover.dataset.importing.text_export import Block, blocks_of_rows, require_blocks
from discover.dataset.importing.text_rows import (
    LARGEST_EXPORT,
    MOST_CELLS,
    Constant,
    constants_of,
    with_points,
)
from discover.dataset.tables.table import read_bytes
from discover.errors import InputError
from discover.validation import require_new_name
from discover.words import unknown_name
from tensor_library.closed_forms import Registry

_MOST_ROWS = 1_048_576  # as Excel
_LONGEST_CELL = 1000  # characters
_GAP = 100  # empty rows


def read_spreadsheet(path: Path) -> list[Block]:
    """Blocks of numbers in all sheets of a workbook; InputError where none, or too large."""
    from openpyxl import load_workbook

    content = io.BytesIO(read_bytes(path, path.name, largest=LARGEST_EXPORT))
    try:
        with zipfile.ZipFile(content) as archive:
            unpacked = sum(part.file_size for part in archive.infolist())
        if unpacked > LARGEST_EXPORT:
            raise InputError(
                f"{path.name} unpacks to {unpacked / 1e6:.0f} MB; the limit is "
                f"{LARGEST_EXPORT / 1e6:.0f} MB. Save the sheets with the measurement in a "
                "workbook of their own, or as CSV."
            )
        book = load_workbook(content, read_only=True, data_only=True, keep_links=False)
    except zipfile.BadZipFile:
        raise InputError(
            f"{path.name} is no .xlsx workbook, or one with a password. Save it as .xlsx without a "
            "password, or each sheet as CSV."
        ) from None
    blocks, left = [], MOST_CELLS
    with contextlib.closing(book):
        for sheet in book.worksheets:
            sheet.reset_dimensions()  # a file may claim any size
            rows, empty = [], 0
            for number, row in enumerate(sheet.iter_rows(values_only=True), start=1):
                left -= len(row)
                if left < 0 or number > _MOST_ROWS:
                    raise InputError(
                        f"{path.name}, sheet {sheet.title}, has more than {MOST_CELLS} cells or "
                        f"{_MOST_ROWS} rows. Keep the sheets with the measurement."
                    )
                empty = 0 if row else empty + 1
                if empty < _GAP:  # after which lines are no longer counted
                    rows.append([_text(cell) for cell in row])
            for block in blocks_of_rows(with_points(rows, path.name)):
                names = filter(None, (str(sheet.title), block.name))
                blocks.append(replace(block, name=", ".join(dict.fromkeys(names))))
    return require_blocks(blocks, path.name)


def _text(cell: object) -> str:
    if cell is None or cell != cell:
        return ""
    return repr(cell) if type(cell) is float else str(cell)[:_LONGEST_CELL]


# The suffix says what the columns are, whatever the file writes above them: RepTate 1.3 divides the
# second column of ``.shear`` and ``.uext`` by the rate to show a viscosity, so it is a stress even
# where it is headed "h" or "Pa-s"   [Boudara, Read & Ramírez 2020, J. Rheol. 64, 709].

_TIME, _STRESS = ("time", "s"), ("stress", "Pa")
_MODULI = (("omega", "rad/s"), ("G'", "Pa"), ("G''", "Pa"))

# names and units of the columns, by suffix; further ones are read by their own names
COLUMNS = {
    ".tts": _MODULI, ".osc": _MODULI, ".shear": (_TIME, _STRESS),
    ".uext": (_TIME, ("tensile stress", "Pa")), ".laos": (_TIME, ("strain", "-"), _STRESS),
    ".creep": (_TIME, ("strain", "-")), ".gt": (_TIME, ("relaxation modulus", "Pa")),
}  # fmt: skip
_PARAMETERS = {
    ".shear": {"gdot": ("shear rate", "1/s")},
    ".uext": {"gdot": ("hencky rate", "1/s"), "edot": ("hencky rate", "1/s")},
    ".creep": {"stress": ("stress", "Pa")},
}
_TEMPERATURE = ("temperature", "°C")


def read_reptate(path: Path) -> list[Block]:
    """Return the block of a file of RepTate; InputError where it lacks columns or a parameter."""
    suffix = path.suffix.lower()
    wanted, parameters = COLUMNS[suffix], _PARAMETERS.get(suffix, {})
    width = len(wanted)
    content = read_bytes(path, path.name, largest=LARGEST_EXPORT)
    lines = re.split(r"\r\n|\r|\n", content.decode("cp1252", "replace"))
    rows = [line.lstrip("#").replace(",", " ").split() for line in lines]
    found = [block for block in blocks_of_rows(rows) if len(block.columns) >= width]
    if not found:
        raise InputError(
            f"{path.name} has no lines of {width} numbers ({', '.join(n for n, _ in wanted)}), as "
            f"a {suffix} file of RepTate has below its first line. Correct it, or give it another "
            "suffix and --format text."
        )
    # a file may hold more columns than its suffix names, under names of their own
    widest = max(found, key=lambda block: len(block.columns)).columns
    own = enumerate(widest[width:], start=width + 1)
    further = [(name or f"column {i}", unit) for i, (name, unit) in own]
    cells = tuple(
        (*row, *[""] * (len(widest) - len(row))) for block in found for row in block.cells
    )
    given = {constant.name: constant.value for constant in constants_of([[lines[0]]])}
    known = {**parameters, "T": _TEMPERATURE}
    constants = tuple(
        Constant(name, given[key], unit) for key, (name, unit) in known.items() if key in given
    )
    if parameters and not {c.name for c in constants} - {_TEMPERATURE[0]}:
        needed = next(iter(parameters))
        raise InputError(
            f"{path.name} does not say its {needed} on the first line, as a {suffix} file of "
            f"RepTate does. Write {needed}=…; there."
        )
    # of a creep file `rec` says that the strain is the recovered one
    name = "recovery" if float(given.get("rec", 0)) else suffix[1:]
    return [Block(name, (*wanted, *further), cells, found[0].line, constants)]


class Importer(NamedTuple):
    """Reader of one kind of file, whose blocks are understood as those of a text export are."""

    read: Callable[[Path], Sequence[Block]]
    suffixes: tuple[str, ...] = ()  # of the names of such files, which need no --format


_BUILT_IN = {
    "spreadsheet": Importer(read_spreadsheet, (".xlsx", ".xlsm")),
    "reptate": Importer(read_reptate, tuple(COLUMNS)),
}

IMPORTERS: Registry[Importer] = Registry("importer", "discover.importers", lambda: _BUILT_IN)
"""Importers by name; a package's own by entry points of this group. Text needs none of them."""
TEXT = "text"  # what may be written as the format of a text export, which is the default


def register_importer(
    name: str, read: Callable[[Path], Sequence[Block]], suffixes: Sequence[str] = ()
) -> Importer:
    """Make an importer of one's own known to `discover data import`.

    Raises InputError if the name is taken or is none, or another importer has a suffix.

    Parameters
    ----------
    name, suffixes
        As ``--format`` is to spell it, in small letters; endings by which such files are known.
    read
        Takes the path of a file and returns its blocks, made with `Block.of`.

    Examples
    --------
    >>> register_importer("house_rheometer", read, suffixes=[".npz"])  # doctest: +SKIP
    """
    require_new_name(name, [TEXT, *IMPORTERS.present], "importer")
    endings = tuple(str(suffix).lower() for suffix in suffixes)
    for other, known in IMPORTERS.present.items():
        if both := set(endings) & set(known.suffixes):
            raise InputError(
                f"Files that end in {sorted(both)[0]} are read by the importer {other!r} already. "
                "Leave that suffix out, and use --format."
            )
    IMPORTERS[name] = Importer(read, endings)
    return IMPORTERS.present[name]


def blocks_of_importer(path: Path, form: str | None) -> list[Block] | None:
    """Blocks that the importer of a name, or of the suffix, reads; None for a file of text."""
    if form == TEXT:
        return None
    if form is not None and form not in IMPORTERS:
        raise InputError(
            f"{unknown_name('format', form, [TEXT, *IMPORTERS])} Install the package that brings "
            "it, or leave --format out."
        )
    ending = path.suffix.lower()
    name = form or next((n for n, one in IMPORTERS.items() if ending in one.suffixes), None)
    if name is None:
        return None
    try:
        blocks = list(IMPORTERS[name].read(path))
    except InputError:
        raise
    except OSError as error:
        raise InputError(
            f"The file {path} cannot be read: {error.strerror or error}. Check the name."
        ) from None
    except Exception as error:
        first = (str(error).splitlines() or [""])[0]
        raise InputError(
            f"The importer {name!r} cannot read {path.name} ({type(error).__name__}: {first}). "
            "Give a file of its kind, or say which kind it is with --format."
        ) from error
    if not blocks or not all(isinstance(block, Block) for block in blocks):
        raise InputError(
            f"The importer {name!r} found no block of numbers in {path.name}. It must return a "
            "list of Block; see docs/adding-a-loader.md."
        )
    return blocks
