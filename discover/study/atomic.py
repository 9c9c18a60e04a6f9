"""Files that are either whole or absent, however a program ends."""

import contextlib
import os
import tempfile
from pathlib import Path

from discover.errors import InputError

PART_SUFFIX = ".discover-part"
"""Ends the name of a file that is being written."""


def write_text(path: str | Path, text: str) -> Path:
    r"""Write a text file so that no reader ever sees half of it.

    The text goes to a temporary file in the same folder, which then takes the name.

    Parameters
    ----------
    path
        The file; its folder must exist.
    text
        The content, written as UTF-8; what UTF-8 cannot hold as ``\udcff``.

    Raises
    ------
    InputError
        If a folder has the file's name.
    OSError
        If the disk is full, say; names the file. What the file held before is still there.
    """
    path = Path(path)
    handle, temporary = tempfile.mkstemp(
        dir=path.parent, prefix=f".{path.name}.", suffix=PART_SUFFIX
    )
    try:
        # a file's name that is no UTF-8 comes as half characters, and may stand in a title
        with os.fdopen(handle, "w", encoding="utf-8", errors="backslashreplace") as stream:
            stream.write(text)
            stream.flush()
            os.fsync(stream.fileno())
        os.chmod(temporary, 0o644)  # mkstemp makes files that only their owner can read
        os.replace(temporary, path)
    except BaseException as error:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        if isinstance(error, IsADirectoryError):
            raise InputError(
                f"{path} is a folder, but a file is to be written there. Remove or rename it."
            ) from None
        if isinstance(error, OSError) and error.errno is not None and error.filename is None:
            # a full disk is reported without a name
            raise OSError(error.errno, os.strerror(error.errno), str(path)) from error
        raise
    return path


def make_folder(path: str | Path) -> Path:
    """Make a folder for results, with its parents."""
    path = Path(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise InputError(f"{path} is a file; give a folder for the results.") from None
    except OSError as error:
        raise InputError(
            f"The folder {path} cannot be made: {error.strerror}. Choose another with --out."
        ) from None
    except ValueError:
        raise InputError(f"{str(path)!r} is no name that a folder can have. Correct it.") from None
    if not os.access(path, os.W_OK | os.X_OK):
        raise InputError(f"The folder {path} cannot be written to. Choose another with --out.")
    return path
