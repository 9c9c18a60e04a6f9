"""Files that are either whole or absent, however a program ends."""

import contextlib
import os
import secrets
import stat
from collections.abc import Sequence
from pathlib import Path

from discover.errors import InputError
from discover.inputs_kept import require_not_read

PART_SUFFIX = ".discover-part"
"""Ends the name of a file that is being written."""


def write_text(path: str | Path, text: str) -> Path:
    r"""Write a text file so that no reader ever sees half of it.

    The text goes to a temporary file in the same folder, which then takes the name. A file that it
    replaces hands on who may read it; for a new one the user's umask decides.

    `path`: the file; its folder must exist. `text`: the content, written as UTF-8; what UTF-8
    cannot hold as ``\udcff``. Raises InputError if something that is no plain file has the name, or
    a file that this command has read. Raises OSError if the disk is full, say; names the file. What
    the file held before is still there.
    """
    path = Path(path)
    before = replaceable(path)
    mode = 0o666 if before is None else stat.S_IMODE(before.st_mode) & 0o777
    temporary = path.parent / f".{path.name[:50]}.{secrets.token_hex(4)}{PART_SUFFIX}"
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0)
    handle = os.open(temporary, flags, mode)  # less what umask takes
    try:
        if before is not None and hasattr(os, "fchmod"):
            os.fchmod(handle, mode)
        # a file's name that is no UTF-8 comes as half characters, and may stand in a title
        with os.fdopen(handle, "w", encoding="utf-8", errors="backslashreplace") as stream:
            stream.write(text)
            stream.flush()
            os.fsync(stream.fileno())
        replaceable(path)  # a disk may take its time, and others theirs
        os.replace(temporary, path)
    except BaseException as error:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        if isinstance(error, OSError) and error.errno is not None and error.filename is None:
            # a full disk is reported without a name
            raise OSError(error.errno, os.strerror(error.errno), str(path)) from error
        raise
    return path


def remove_file(path: str | Path) -> None:
    """Remove a file, if there is one, under the conditions of `write_text`."""
    if replaceable(Path(path)) is not None:
        os.unlink(path)


def replaceable(path: Path) -> os.stat_result | None:
    """Return what the system says of a file that may be replaced; None if there is none.

    Raises InputError if what has the name is no plain file, or a file that this command has read.
    """
    try:
        found = os.lstat(path)
    except OSError:
        return None  # what is wrong with the folder, opening tells
    if not stat.S_ISREG(found.st_mode):
        kinds = (
            (stat.S_ISDIR, "a folder"), (stat.S_ISLNK, "a link"), (stat.S_ISFIFO, "a pipe"),
            (stat.S_ISSOCK, "a socket"),
        )  # fmt: skip
        kind = next((words for holds, words in kinds if holds(found.st_mode)), "a device")
        raise InputError(
            f"{path} is {kind}, but a file is to be written there. Remove it, or choose another "
            "name."
        )
    require_not_read(path, found)
    return found


def require_ours(folder: Path, names: Sequence[str], mark: str) -> None:
    """Refuse a folder that holds files of these names, where nothing shows that they are ours.

    `names`: of results that are about to be written there. `mark`: name of what is always written
    first, and shows that the rest is ours. Raises InputError if one of them would be written over.
    """
    if os.path.lexists(folder / mark):
        return
    there = next((name for name in names if os.path.lexists(folder / name)), None)
    if there is not None:
        raise InputError(
            f"{folder} holds a {there} that is no result of this command. Use --overwrite to "
            "replace it, or another --out."
        )


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
