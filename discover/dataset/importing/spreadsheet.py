"""Spreadsheets: every sheet of an .xlsx file as the table of cells that it is."""

import io
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from discover.dataset.importing.text_export import Block, blocks_of_rows, require_blocks
from discover.dataset.importing.text_rows import LARGEST_EXPORT, MOST_CELLS, with_points
from discover.dataset.tables.table import read_bytes
from discover.errors import InputError

_LARGEST_PART = 10_000_000
"""Bytes of a part that is no sheet: the list of sheets, or styles, which are read as objects."""

_MOST_COLUMNS = 2000
_MOST_ROWS = 1_048_576  # as Excel
_LONGEST_CELL = 1000  # characters


def read_spreadsheet(path: Path) -> list[Block]:
    """Return the blocks of numbers in all sheets of a spreadsheet; a sheet names what has no name.

    Raises InputError if it is no spreadsheet, is larger than a measurement, or holds no numbers
    under names.
    """
    from openpyxl import load_workbook

    content = io.BytesIO(read_bytes(path, path.name, largest=LARGEST_EXPORT))
    try:
        _require_size(content, path.name)
        book = load_workbook(content, read_only=True, data_only=True, keep_links=False)
    except zipfile.BadZipFile:
        raise InputError(
            f"{path.name} is no .xlsx workbook, or one with a password. Save it as .xlsx without a "
            "password, or each sheet as CSV."
        ) from None
    blocks = []
    left = MOST_CELLS
    try:
        for sheet in book.worksheets:
            sheet.reset_dimensions()  # a file may claim any size
            rows = []
            for row in _rows(sheet, path.name):
                left -= len(row)
                if left < 0:
                    raise InputError(
                        f"{path.name} has more than {MOST_CELLS} cells. Keep the sheets with the "
                        "measurement."
                    )
                rows.append([_text(cell) for cell in row])
            for block in blocks_of_rows(with_points(rows, path.name)):
                names = filter(None, (str(sheet.title), block.name))
                blocks.append(replace(block, name=", ".join(dict.fromkeys(names))))
    finally:
        book.close()
    return require_blocks(blocks, path.name)


def _require_size(content: io.BytesIO, name: str) -> None:
    """Refuse a workbook that would unpack to more than a measurement."""
    with zipfile.ZipFile(content) as archive:
        parts = archive.infolist()
    # what a part says of its size is what is read of it at most
    whole = sum(part.file_size for part in parts)
    if whole > LARGEST_EXPORT:
        raise InputError(
            f"{name} unpacks to {whole / 1e6:.0f} MB; the limit is {LARGEST_EXPORT / 1e6:.0f} "
            "MB. Save the sheets with the measurement in a workbook of their own, or as CSV."
        )
    for part in parts:
        is_table = "worksheets/" in part.filename or "sharedStrings" in part.filename
        if part.file_size > _LARGEST_PART and not is_table and part.filename.endswith("ml"):
            raise InputError(
                f"{name} has {part.file_size / 1e6:.0f} MB in {part.filename}, which holds no "
                "measurement. Copy the numbers to a new workbook, or save each sheet as CSV."
            )


def _rows(sheet, name: str) -> Iterator[tuple]:
    """Yield the rows of a sheet as wide as they are filled, a gap of many rows as one."""
    empty = 0
    for number, row in enumerate(sheet.iter_rows(values_only=True), start=1):
        if number > _MOST_ROWS:
            raise InputError(
                f"{name}, sheet {sheet.title}, has a cell below row {_MOST_ROWS}. Delete what "
                "stands far below the measurement."
            )
        if len(row) > _MOST_COLUMNS:
            raise InputError(
                f"{name}, sheet {sheet.title}, has a cell in column {len(row)} of row {number}; "
                f"the limit is {_MOST_COLUMNS} columns. Delete what stands far to the right of the "
                "measurement."
            )
        empty = 0 if row else empty + 1
        if empty < _GAP:
            yield row


_GAP = 100
"""Empty rows, after which lines are no longer counted."""


def _text(cell: object) -> str:
    if cell is None or cell != cell:
        return ""
    return repr(cell) if type(cell) is float else str(cell)[:_LONGEST_CELL]
