"""Where exported programs lie: beside what JAX compiled, stamped with the code they are from."""

import hashlib
import importlib.metadata
import importlib.util
import json
import os
import platform
import shutil
import tempfile
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import jax

from discover.compilation_cache import is_ours_alone

_LIBRARIES = ("jax", "jaxlib", "equinox", "diffrax", "optimistix", "lineax", "numpy", "scipy")
_MAGIC = b"discover-program-1\n"
_STAMPS_KEPT = 3

FOLDER = "discover-programs"
"""Under JAX's folder, which may be one that others keep things in as well."""

STAMP_FILE = ".discover-programs"
"""Lies in every folder that this module made, and may therefore remove."""


def program_folder() -> Path | None:
    """Return where programs of this code are kept; None where JAX keeps none either."""
    folder = jax.config.jax_compilation_cache_dir  # pyright: ignore[reportAttributeAccessIssue]
    plain = jax.config.jax_disable_jit or jax.config.jax_debug_nans  # pyright: ignore
    if not folder or plain or os.environ.get("DISCOVER_NO_CACHE"):
        return None
    return _prepared(Path(folder) / FOLDER, _stamp(_circumstances()))


def _circumstances() -> str:
    """Return what else decides how a function is traced."""
    config = jax.config
    return json.dumps(
        [jax.default_backend(), bool(config.jax_enable_x64), os.environ.get("EQX_ON_ERROR")]  # pyright: ignore
    )


@cache
def _stamp(circumstances: str) -> str:
    """Return a digest of the sources that programs come from, and of the libraries' versions."""
    total = hashlib.blake2b(digest_size=12)
    versions = [importlib.metadata.version(name) for name in _LIBRARIES]
    told = [platform.python_version(), platform.machine(), *versions, circumstances]
    total.update(json.dumps(told).encode())
    for package in ("discover", "tensor_library"):
        spec = importlib.util.find_spec(package)
        for root in (spec.submodule_search_locations or ()) if spec else ():
            for file in sorted(Path(root).rglob("*.py")):
                total.update(str(file.relative_to(root)).encode())
                total.update(file.read_bytes())
    return total.hexdigest()


@cache
def _prepared(parent: Path, stamp: str) -> Path | None:
    """Make the folder of a stamp, and remove those of code that is no longer used."""
    folder = parent / stamp
    try:
        for part in (parent, folder):
            if not is_ours_alone(part.parent):
                return None
            part.mkdir(mode=0o700, exist_ok=True)
        if not is_ours_alone(folder):
            return None
        (folder / STAMP_FILE).touch()
        os.utime(folder)
        old = [path for path in parent.iterdir() if (path / STAMP_FILE).is_file()]
        old.sort(key=lambda path: path.stat().st_mtime, reverse=True)
    except OSError:
        return None
    for path in old[_STAMPS_KEPT:]:
        shutil.rmtree(path, ignore_errors=True)  # of a link it makes nothing
    return folder


def save_program(file: Path, nesting: Any, exported: bytes) -> None:
    """Write a program whole or not at all; a full disk costs the next start time, not this run."""
    head = json.dumps(nesting).encode() + b"\n"
    body = head + exported
    with suppress(OSError):
        handle, name = tempfile.mkstemp(dir=file.parent, prefix=".")
        try:
            with os.fdopen(handle, "wb") as stream:
                stream.write(_MAGIC + hashlib.sha256(body).digest() + body)
            os.replace(name, file)
        except OSError:
            Path(name).unlink(missing_ok=True)
            raise


def load_program(file: Path) -> tuple[Any, bytes] | None:
    """Return nesting and program; None where there is none, or it is cut short or altered."""
    try:
        data = file.read_bytes()
    except OSError:
        return None
    start = len(_MAGIC) + 32
    body = data[start:]
    if data[: len(_MAGIC)] != _MAGIC or hashlib.sha256(body).digest() != data[len(_MAGIC) : start]:
        return None
    head, _, exported = body.partition(b"\n")
    return json.loads(head), exported
