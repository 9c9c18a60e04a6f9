"""Spreadsheets: every sheet of an .xlsx file as the table of cells that it is."""

from pathlib import Path

from discover.dataset.importing.text_export import Block, blocks_of_rows
from discover.dataset.importing.text_rows import with_points
from discover.errors import InputError


def read_spreadsheet(path: Path) -> list[Block]:
    """Return the blocks of numbers in all sheets of a spreadsheet; a sheet names what has no name.

    Raises
    ------
    InputError
        If the package that opens it is missing, or it holds no numbers under names.
    """
    import pandas as pd

    try:
        sheets = pd.read_excel(path, sheet_name=None, header=None, dtype=object, engine="openpyxl")
    except ImportError:
        raise InputError(
            f"{path.name} is a spreadsheet, and the package that opens it is not installed. "
            "Install it with: pip install openpyxl. Or save each sheet as CSV."
        ) from None
    blocks = []
    for title, sheet in sheets.items():
        rows = [
            ["" if cell is None or cell != cell else _text(cell) for cell in row]
            for row in sheet.to_numpy(dtype=object).tolist()
        ]
        for block in blocks_of_rows(with_points(rows, path.name)):
            name = block.name or str(title)
            blocks.append(Block(name, block.columns, block.cells, block.line, block.constants))
    if not blocks:
        raise InputError(
            f"{path.name} holds no lines of numbers under a line of names on any of its sheets. "
            "Save the sheet with the measurement, names and units above the numbers."
        )
    return blocks


def _text(cell: object) -> str:
    return repr(cell) if type(cell) is float else str(cell)
