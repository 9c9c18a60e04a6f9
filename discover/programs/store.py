"""Machine code kept between starts, under a digest of what it was made from."""

import hashlib
import importlib.metadata
import importlib.util
import io
import os
import pickle
import platform
import tempfile
import types
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import jax
import numpy as np

from discover.compilation_cache import count_program, is_ours_alone

FOLDER = "discover-programs"
"""Under JAX's folder, which may be one that others keep things in as well."""

_SUFFIX = ".discover-code"
_FILES_KEPT = 300  # the last written: those of earlier versions go

_OURS = ("discover", "tensor_library")
_LIBRARIES = ("jax", "jaxlib", "equinox", "numpy", "llvmlite")
_VERSIONED = {
    *_OURS, *_LIBRARIES, "builtins", "functools", "operator", "math", "collections", "copyreg",
}  # fmt: skip
"""Packages whose code the stamp tells from that of another version."""


def kept(made_from: Any, write: Callable[[], tuple[bytes, bool]]) -> bytes:
    """Return machine code that an earlier start made of the same, or write and keep it.

    `made_from`: what tells it from other code; see `digest_of`. `write`: returns the code, and
    whether it stands alone: what calls functions of this process is not kept.
    """
    folder, digest = program_folder(), digest_of(made_from)
    if folder is None or digest is None:
        return write()[0]
    file = folder / f"{digest}{_SUFFIX}"
    found = _load(file)
    count_program(found is not None)
    if found is not None:
        return found
    code, stands_alone = write()
    if stands_alone:
        _save(file, code)
    return code


def program_folder() -> Path | None:
    """Return where machine code is kept; None where JAX keeps no programs either."""
    config: Any = jax.config
    place = config.jax_compilation_cache_dir
    if not place or os.environ.get("DISCOVER_NO_CACHE"):
        return None
    folder = Path(place) / FOLDER
    with suppress(OSError):
        if is_ours_alone(folder.parent):
            folder.mkdir(mode=0o700, exist_ok=True)
            return folder if is_ours_alone(folder) else None
    return None


def digest_of(value: Any) -> str | None:
    """Return a digest of what decides a program; None of code that no version here names.

    Arrays count with type and shape only. Code of a user may change from one start to the next.
    """
    stream = io.BytesIO()
    described = _Described(stream)
    described.fast = True  # by value: whether one object stands twice or two alike is no difference
    try:
        described.dump((_stamp(), bool(jax.config.jax_enable_x64), value))  # pyright: ignore
    except (pickle.PicklingError, AttributeError, TypeError, ValueError, RecursionError):
        return None
    return hashlib.blake2b(stream.getvalue(), digest_size=20).hexdigest()


class _Described(pickle.Pickler):
    """Writes what a value is made of, and refuses code of packages known by no version."""

    def reducer_override(self, value: Any) -> Any:
        if isinstance(value, (type, types.FunctionType)):
            package = (value.__module__ or "").partition(".")[0]
            if package not in _VERSIONED:
                raise pickle.PicklingError(f"code of {package}")
        elif isinstance(value, (np.ndarray, jax.Array)):
            return str, (f"{value.dtype} {value.shape}",)
        # a name in a field may stand for code that is another user's
        elif beside := getattr(value, "digest_beside_fields", ()):
            return tuple, ((type(value), vars(value), beside),)
        return NotImplemented


@cache
def _stamp() -> str:
    """Return a digest of the sources that programs come from, and of the libraries' versions."""
    versions = [importlib.metadata.version(name) for name in _LIBRARIES]
    total = hashlib.blake2b(repr([platform.python_version(), *versions]).encode(), digest_size=12)
    for package in _OURS:
        spec = importlib.util.find_spec(package)
        for root in (spec.submodule_search_locations or ()) if spec else ():
            for file in sorted(Path(root).rglob("*.py")):
                total.update(str(file.relative_to(root)).encode())
                total.update(file.read_bytes())
    return total.hexdigest()


def _save(file: Path, code: bytes) -> None:
    """Write code whole or not at all; a full disk costs the next start time, not this run."""
    with suppress(OSError):
        handle, name = tempfile.mkstemp(dir=file.parent, prefix=".")
        try:
            with os.fdopen(handle, "wb") as stream:
                stream.write(hashlib.sha256(code).digest() + code)
            os.replace(name, file)
        except OSError:
            Path(name).unlink(missing_ok=True)
            raise
        ours = sorted(file.parent.glob(f"*{_SUFFIX}"), key=lambda path: path.stat().st_mtime)
        for old in ours[:-_FILES_KEPT]:
            old.unlink(missing_ok=True)


def _load(file: Path) -> bytes | None:
    """Return code; None where there is none, or it is cut short or altered."""
    with suppress(OSError):
        data = file.read_bytes()
        if hashlib.sha256(data[32:]).digest() == data[:32]:
            return data[32:]
    return None
