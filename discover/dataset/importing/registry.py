"""Importers of a user's own: readers of files that are no text, or no text that is known here."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from discover.dataset.importing.reptate import COLUMNS, read_reptate
from discover.dataset.importing.spreadsheet import read_spreadsheet
from discover.dataset.importing.text_export import Block
from discover.errors import InputError
from discover.new_names import require_new_name
from discover.words import unknown_name
from tensor_library.registry import Registry


@dataclass(frozen=True)
class Importer:
    """A reader of one kind of file.

    `read`: takes the path of a file and returns its blocks of columns; names and units are
        understood, and units converted, as those of a text export are.
    `suffixes`: endings of the names of such files, such as ``.npz``; these need no ``--format``.
    """

    read: Callable[[Path], Sequence[Block]]
    suffixes: tuple[str, ...] = ()


def _built_in() -> dict[str, Importer]:
    return {
        "spreadsheet": Importer(read_spreadsheet, (".xlsx", ".xlsm")),
        "reptate": Importer(read_reptate, tuple(COLUMNS)),
    }


IMPORTERS: Registry[Importer] = Registry("importer", "discover.importers", _built_in)
"""Importers by name; a package's own by entry points of this group. Text needs none of them."""

TEXT = "text"
"""What may be written as the format of a text export, which is the default."""


def register_importer(
    name: str, read: Callable[[Path], Sequence[Block]], suffixes: Sequence[str] = ()
) -> Importer:
    """Make an importer of one's own known to `discover data import`.

    Parameters
    ----------
    name
        As ``--format`` is to spell it: lower-case letters, digits and underscores.
    read
        Takes the path of a file and returns its blocks, made with `Block.of`.
    suffixes
        Endings of names by which such files are known.

    Raises
    ------
    InputError
        If the name is taken or is none, or another importer has one of the suffixes.

    Examples
    --------
    >>> import discover as dc
    >>> dc.register_importer("house_rheometer", read, suffixes=[".npz"])  # doctest: +SKIP
    """
    require_new_name(name, [TEXT, *IMPORTERS.present], "importer")
    endings = tuple(str(suffix).lower() for suffix in suffixes)
    for other, known in IMPORTERS.present.items():
        both = set(endings) & set(known.suffixes)
        if both:
            raise InputError(
                f"Files that end in {sorted(both)[0]} are read by the importer {other!r} already. "
                "Leave that suffix out, and use --format."
            )
    IMPORTERS[name] = Importer(read, endings)
    return IMPORTERS.present[name]


def blocks_of_importer(path: Path, form: str | None) -> list[Block] | None:
    """Return the blocks of a file that an importer reads; None if it is to be read as text.

    `form`: name of the importer; by the suffix of the file if None. Raises InputError if there is
    no such importer, or it cannot read the file.
    """
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
