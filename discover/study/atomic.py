"""Files that are whole or absent, and one process at a time in a folder of them."""

import contextlib
import os
import secrets
import socket
import stat
import weakref
from collections.abc import Iterable
from pathlib import Path

from discover.errors import InputError
from discover.inputs_kept import require_not_read

PART_SUFFIX = ".discover-part"
"""Ends the name of a file that is being written."""


def write_text(path: str | Path, text: str) -> Path:
    """Write a text file whole or not at all; InputError for no plain file, or one that was read."""
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


def replaceable(path: Path) -> os.stat_result | None:
    """Return the status of a file that may be replaced; None without, InputError if it may not."""
    try:
        found = os.lstat(path)
    except OSError:
        return None  # what is wrong with the folder, opening tells
    if not stat.S_ISREG(found.st_mode):
        raise InputError(
            f"{path} is no plain file but a folder, a link or a device, and a file is to be "
            "written there. Remove it, or choose another name."
        )
    require_not_read(path, found)
    return found


def require_free(folder: Path, names: Iterable[str], mark: str | None = None) -> None:
    """Refuse a folder that holds files of these names, unless `mark`, written first, is there."""
    there = next((name for name in names if os.path.lexists(folder / name)), None)
    if there is None or (mark is not None and os.path.lexists(folder / mark)):
        return
    which, them = "that is not a result of this command", "it"
    if mark is None:
        which, them = "already", "the files of the same names"
    raise InputError(
        f"{folder} holds a {there} {which}. Use --overwrite to replace {them}, or another --out."
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
        raise InputError(f"{str(path)!r} is not a valid folder name.") from None
    if not os.access(path, os.W_OK | os.X_OK):
        raise InputError(f"The folder {path} cannot be written to. Choose another with --out.")
    return path


try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

LOCK_FILE = ".discover-lock"
_LOCKING = os.O_RDWR | os.O_CREAT | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOFOLLOW", 0)

# Locks of this process by folder; several RunFolder objects of one process share one
_held: "weakref.WeakValueDictionary[str, FolderLock]" = weakref.WeakValueDictionary()


class FolderLock:
    """A lock on a folder, until `release`, or the process ends; none where a disk knows none."""

    def __init__(self, path: Path, descriptor: int):
        self.path = path
        self._finalizer = weakref.finalize(self, _release, path, descriptor, os.getpid())

    def release(self) -> None:
        """Let others into the folder."""
        self._finalizer()


def lock_folder(folder: str | Path) -> FolderLock:
    """Lock a folder for this process, once; InputError names another process that works in it."""
    path = Path(folder).resolve() / LOCK_FILE
    held = _held.get(str(path))
    if held is not None and held._finalizer.alive:
        return held
    for _ in range(20):
        descriptor = os.open(path, _LOCKING, 0o644)
        if not _take(descriptor):
            who = os.read(descriptor, 100).decode("ascii", "replace") or "another process"
            os.close(descriptor)
            raise InputError(
                f"{folder} is in use by {who}. Wait for it, stop it, or use another --out."
            )
        # the former owner may have removed the file between our opening and locking it
        with contextlib.suppress(OSError):
            if os.fstat(descriptor).st_ino == os.stat(path).st_ino:
                break
        os.close(descriptor)
    else:
        raise InputError(f"{folder} cannot be locked: others come and go in it. Use another --out.")
    os.ftruncate(descriptor, 0)
    os.write(descriptor, f"process {os.getpid()} on {socket.gethostname()[:60]}".encode())
    lock = FolderLock(path, descriptor)
    _held[str(path)] = lock
    return lock


def _take(descriptor: int) -> bool:
    if fcntl is None:
        return True
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        pass  # a file system without locks
    return True


def _release(path: Path, descriptor: int, pid: int) -> None:
    if os.getpid() != pid:
        return  # a forked child never held it
    with contextlib.suppress(OSError):
        # removed while still locked: nobody can hold a lock on a file that is about to go
        os.unlink(path)
    with contextlib.suppress(OSError):
        os.close(descriptor)
