"""No command writes over a file that it read."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from discover.errors import InputError

_read: dict[tuple[int, int], str] | None = None
"""Path of every file that this command has read, by device and number; None outside of one."""


@contextmanager
def inputs_kept() -> Iterator[None]:
    """Keep every file that a command reads from being written over while the context lasts."""
    global _read
    before, _read = _read, {}
    try:
        yield
    finally:
        _read = before


def note_input(path: str | Path, status: os.stat_result) -> None:
    """Take note of a file that a command reads."""
    if _read is not None:
        _read[status.st_dev, status.st_ino] = os.path.realpath(path)


def require_not_read(path: str | Path, status: os.stat_result) -> None:
    """Raise InputError if a file to be replaced or removed was read by this command."""
    source = (_read or {}).get((status.st_dev, status.st_ino))
    # the number of a file that is gone may be given to another
    if source is not None and os.path.exists(source) and os.path.samefile(source, path):
        raise InputError(
            f"{path} is a file that this command reads, and it is not written over. Give another "
            "name or folder with --out."
        )
