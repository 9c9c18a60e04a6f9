"""Text tables, read safely and with errors that name file, column and line."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Float

from discover.dataset.units import Quantity, find_column
from discover.errors import InputError


@dataclass(frozen=True)
class Table:
    """A CSV file as text.

    Attributes
    ----------
    name
        Name of the file, for messages.
    columns
        Text of every column.
    """

    name: str
    columns: Mapping[str, Sequence[str]]

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def numbers(self, column: str) -> Float[np.ndarray, " n"]:
        """Return a column as finite numbers.

        Raises
        ------
        InputError
            If a cell is not a finite number.
        """
        text = self.columns[column]
        values = np.asarray(pd.to_numeric(pd.Series(text), errors="coerce"), dtype=float)
        if not np.all(np.isfinite(values)):
            row = int(np.argmin(np.isfinite(values)))
            cell = str(text[row]).strip() or "nothing"
            # line 1 is the header
            raise InputError(
                f"{column} in {self.name} must hold finite numbers; line {row + 2} holds {cell}. "
                "Correct that line or remove it."
            )
        return values

    def quantity(self, quantity: Quantity) -> Float[np.ndarray, " n"] | None:
        """Return a known quantity in SI units, or None if no column holds it.

        Raises
        ------
        InputError
            If its unit or a cell is wrong.
        """
        try:
            found = find_column(tuple(self.columns), quantity)
        except InputError as error:
            raise InputError(f"{self.name}: {error}") from error
        if found is None:
            return None
        column, factor = found
        return self.numbers(column) * factor

    def required(self, quantity: Quantity) -> Float[np.ndarray, " n"]:
        """Return a known quantity in SI units.

        Raises
        ------
        InputError
            If no column holds it, or its unit or a cell is wrong.
        """
        values = self.quantity(quantity)
        if values is None:
            raise InputError(
                f"{self.name} has no column {quantity.column}; its columns are "
                f"{', '.join(self.columns)}. Add it, or rename the column that holds it."
            )
        return values


def read_table(path: Path, name: str | None = None) -> Table:
    """Return a CSV file with a header line as text.

    Parameters
    ----------
    path
        The file.
    name
        Its name in messages; the file's own by default.

    Raises
    ------
    InputError
        If the file is missing, empty or not a table.
    """
    name = path.name if name is None else name
    try:
        frame = pd.read_csv(
            path,
            dtype=str,
            keep_default_na=False,
            encoding="utf-8-sig",
            skipinitialspace=True,
            index_col=False,
            on_bad_lines="error",
        )
    except FileNotFoundError as error:
        raise InputError(
            f"There is no file {name} in {path.parent.name or path.parent}. Add it, or take its "
            "line out of runs.csv."
        ) from error
    except pd.errors.EmptyDataError as error:
        raise InputError(f"{name} is empty; it must hold a header and rows.") from error
    except (pd.errors.ParserError, UnicodeDecodeError) as error:
        reason = str(error).strip().splitlines()[-1]
        raise InputError(
            f"{name} is not a comma-separated table in UTF-8: {reason}. Save it as CSV."
        ) from error
    except OSError as error:
        raise InputError(f"{name} cannot be read: {error.strerror or error}.") from error
    columns = [str(column).strip() for column in frame.columns]
    repeated = [column for column in columns if columns.count(column) > 1]
    if repeated:
        raise InputError(f"{name} has two columns named {repeated[0]}; keep one.")
    if len(frame) == 0:
        raise InputError(f"{name} has a header but no rows.")
    return Table(name, {column: frame.iloc[:, i].tolist() for i, column in enumerate(columns)})
