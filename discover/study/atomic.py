"""Files that are either whole or absent, however a program ends."""

import contextlib
import os
import tempfile
from pathlib import Path

from discover.errors import InputError


def write_text(path: str | Path, text: str) -> Path:
    """Write a text file so that no reader ever sees half of it.

    The text goes to a temporary file in the same folder, which then takes the name.

    Parameters
    ----------
    path
        The file; its folder must exist.
    text
        The content, written as UTF-8.
    """
    path = Path(path)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".part")
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as stream:
            stream.write(text)
            stream.flush()
            os.fsync(stream.fileno())
        os.chmod(temporary, 0o644)  # mkstemp makes files that only their owner can read
        os.replace(temporary, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        raise
    return path


def make_folder(path: str | Path) -> Path:
    """Make a folder for results, with its parents.

    Raises
    ------
    InputError
        If it cannot be made or written to.
    """
    path = Path(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise InputError(f"{path} is a file; give a folder for the results.") from None
    except OSError as error:
        raise InputError(f"The folder {path} cannot be made: {error.strerror}.") from None
    if not os.access(path, os.W_OK | os.X_OK):
        raise InputError(f"The folder {path} cannot be written to. Choose another with --out.")
    return path
