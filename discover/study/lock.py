"""One process at a time in a result folder."""

import contextlib
import json
import os
import socket
import stat
import weakref
from pathlib import Path

from discover.errors import InputError

try:
    import fcntl
except ImportError:  # Windows: only the process id in the file speaks
    fcntl = None

LOCK_FILE = ".discover-lock"

# Locks of this process by folder; several RunFolder objects of one process share one
_held: "weakref.WeakValueDictionary[str, FolderLock]" = weakref.WeakValueDictionary()


class FolderLock:
    """A lock on a folder, held until `release`, until it is forgotten, or until the process ends.

    The operating system holds the lock and drops it however the process ends, so that a lock left
    behind by a killed process is no lock. Where a file system knows no locks, the process and host
    named in the file decide: a process that no longer runs on this host holds nothing.

    No clock is involved: a lock does not age.
    """

    def __init__(self, path: Path, descriptor: int):
        self.path = path
        self._finalizer = weakref.finalize(self, _release, path, descriptor, os.getpid())

    def release(self) -> None:
        """Let others into the folder."""
        self._finalizer()


def lock_folder(folder: str | Path) -> FolderLock:
    """Lock a folder for this process; returns the same lock if this process holds it already.

    Raises InputError if another process works in the folder; the message names it.
    """
    path = Path(folder).resolve() / LOCK_FILE
    held = _held.get(str(path))
    if held is not None and held._finalizer.alive:
        return held
    for _ in range(20):
        descriptor = _open(path)
        owner = _owner(descriptor)
        if not _take(descriptor, owner):
            os.close(descriptor)
            raise InputError(_busy(Path(folder), owner))
        # the former owner may have removed the file between our opening and locking it
        with contextlib.suppress(OSError):
            if os.fstat(descriptor).st_ino == os.stat(path).st_ino:
                break
        os.close(descriptor)
    else:
        raise InputError(f"{folder} cannot be locked: others come and go in it. Use another --out.")
    os.ftruncate(descriptor, 0)
    me = {"pid": os.getpid(), "host": socket.gethostname()}
    os.lseek(descriptor, 0, os.SEEK_SET)
    os.write(descriptor, json.dumps(me).encode())
    lock = FolderLock(path, descriptor)
    _held[str(path)] = lock
    return lock


def _open(path: Path) -> int:
    """Open the lock file; whatever else somebody put in its place is refused, and not written."""
    flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOFOLLOW", 0)
    try:
        descriptor = os.open(path, flags, 0o644)
    except OSError as error:
        if not os.path.lexists(path) or (path.is_file() and not path.is_symlink()):
            raise
        raise InputError(_no_lock(path)) from error
    found = os.fstat(descriptor)
    # a file of two names is somebody's other file too
    if stat.S_ISREG(found.st_mode) and found.st_nlink <= 1:
        return descriptor
    os.close(descriptor)
    raise InputError(_no_lock(path))


def _no_lock(path: Path) -> str:
    return (
        f"{path} is no plain file with one name, so the folder cannot be locked. Remove it, or use "
        "another --out."
    )


def _take(descriptor: int, owner: dict) -> bool:
    if fcntl is not None:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        except BlockingIOError:
            return False
        except OSError:
            pass  # a file system without locks
    if not owner:
        return True
    return owner.get("host") == socket.gethostname() and not _runs(owner.get("pid"))


def _owner(descriptor: int) -> dict:
    try:
        owner = json.loads(os.read(descriptor, 4096))
    except (OSError, ValueError, RecursionError):
        return {}  # being written, or damaged
    return owner if isinstance(owner, dict) else {}


def _runs(pid: object) -> bool:
    if not isinstance(pid, int) or isinstance(pid, bool) or not 0 < pid < 2**31:
        return False
    if pid == os.getpid():
        return False  # a namesake of the past: this process would be in `_held`
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True  # runs, and belongs to somebody else
    return True


def _busy(folder: Path, owner: dict) -> str:
    pid, host = owner.get("pid"), owner.get("host")
    who = f"process {pid} on {host}" if isinstance(pid, int) else "another process"
    return (
        f"{folder} is in use by {str(who)[:120]}. Wait for it, stop it, or use another --out. If "
        f"it is long gone, remove {folder / LOCK_FILE}."
    )


def _release(path: Path, descriptor: int, pid: int) -> None:
    if os.getpid() != pid:
        return  # a forked child never held it
    with contextlib.suppress(OSError):
        # removed while still locked: nobody can hold a lock on a file that is about to go
        os.unlink(path)
    with contextlib.suppress(OSError):
        os.close(descriptor)
