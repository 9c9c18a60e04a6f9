"""Where exported programs lie: beside what JAX compiled, stamped with the code they are from."""

import dataclasses
import enum
import hashlib
import importlib.metadata
import importlib.util
import json
import os
import platform
import shutil
import sys
import tempfile
import types
from collections.abc import Iterable
from contextlib import suppress
from functools import cache, partial
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import numpy as np

from discover.compilation_cache import count_program, is_ours_alone

_LIBRARIES = ("jax", "jaxlib", "equinox", "diffrax", "optimistix", "lineax", "numpy", "scipy")
_MAGIC = b"discover-program-1\n"
_STAMPS_KEPT = 3

FOLDER = "discover-programs"
"""Under JAX's folder, which may be one that others keep things in as well."""

STAMP_FILE = ".discover-programs"
"""Lies in every folder that this module made, and may therefore remove."""


def program_folder() -> Path | None:
    """Return where programs of this code are kept; None where JAX keeps none either."""
    config: Any = jax.config
    plain = config.jax_disable_jit or config.jax_debug_nans
    if plain or os.environ.get("DISCOVER_NO_CACHE"):
        return None
    # what decides how a function is traced
    traced = bool(config.jax_enable_x64), os.environ.get("EQX_ON_ERROR")
    return _folder(config.jax_compilation_cache_dir, *traced)  # asked at every call of a program


@cache
def _folder(folder: str | None, *circumstances: Any) -> Path | None:
    if not folder:
        return None
    stamp = _stamp(json.dumps([jax.default_backend(), *circumstances]))
    return _prepared(Path(folder) / FOLDER, stamp)


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
    data = b""
    with suppress(OSError):
        data = file.read_bytes()
    start = len(_MAGIC) + 32
    body = data[start:]
    whole = _MAGIC + hashlib.sha256(body).digest() == data[:start]
    count_program(whole)
    if not whole:
        return None
    head, _, exported = body.partition(b"\n")
    return json.loads(head), exported


OURS = ("discover", "tensor_library")
_VERSIONED = {
    *OURS, "jax", "jaxlib", "equinox", "diffrax", "optimistix", "lineax", "numpy", "scipy",
    "builtins", "functools", "operator", "math", "collections",
}  # fmt: skip
"""Packages whose code the stamp of the store tells apart, see `discover.programs.store`."""

_SIMPLE = (type(None), bool, int, float, complex, str, bytes, type(Ellipsis), type(NotImplemented))


class NotDescribable(Exception):
    """Something that no digest can describe."""


def fingerprint(value: Any, arrays_by_content: bool) -> bytes:
    """Return a digest of a value, such as the arguments of a function, or the function.

    `arrays_by_content`: whether an array counts with its numbers, as where they are built into a
    program, or with shape and type only, as an argument does. Raises NotDescribable of code outside
    the packages known by version, an object that refers to itself, a device's handle.
    """
    return _Walk().digest(value, arrays_by_content)


class _Walk:
    def __init__(self):
        self._above: set[int] = set()

    def digest(self, value: Any, content: bool) -> bytes:
        if id(value) in self._above:
            raise NotDescribable("an object that refers to itself")
        self._above.add(id(value))
        try:
            return _hash(self._parts(value, content))
        finally:
            self._above.discard(id(value))

    def _each(self, values: Iterable[Any], content: bool) -> Iterable[bytes]:
        return (self.digest(value, content) for value in values)

    def _parts(self, value: Any, content: bool) -> Iterable[bytes]:
        if isinstance(value, _SIMPLE) and type(value) in _SIMPLE:
            return [type(value).__name__.encode(), repr(value).encode()]
        if isinstance(value, enum.Enum):
            return [_name(type(value)), value.name.encode()]
        if eqx.is_array(value):
            return self._array(value, content)
        if isinstance(value, np.dtype):
            return [b"dtype", value.str.encode()]
        if isinstance(value, type):
            return [b"class", _name(value)]
        if callable(value) and (named := found_by_name(value)) is not None:
            return [b"named", named]
        if isinstance(value, types.FunctionType):
            return self._function(value)
        if isinstance(value, types.MethodType):
            return [b"method", *self._each([value.__self__, value.__func__], True)]
        if isinstance(value, partial):
            return [b"partial", *self._each([value.func, value.args, value.keywords], True)]
        if isinstance(value, types.CodeType):
            return self._code(value)
        if isinstance(value, (dict, types.MappingProxyType)):
            pairs = [
                _hash([self.digest(k, True), self.digest(v, content)]) for k, v in value.items()
            ]
            return [_name(type(value)), *sorted(pairs)]
        if isinstance(value, (set, frozenset)):
            return [_name(type(value)), *sorted(self._each(value, True))]
        return self._structure(value, content)

    def _array(self, value: Any, content: bool) -> Iterable[bytes]:
        if not hasattr(value, "dtype") or value.dtype == object:
            raise NotDescribable("an array of objects")
        if jax.dtypes.issubdtype(value.dtype, jax.dtypes.extended):
            raise NotDescribable("an array of keys")
        weak = bool(getattr(value, "weak_type", False))
        head = [b"array", str(value.dtype).encode(), str((np.shape(value), weak)).encode()]
        return [*head, np.ascontiguousarray(value).tobytes()] if content else head

    def _function(self, value: types.FunctionType) -> Iterable[bytes]:
        _require_known(value.__module__)
        cells = [cell.cell_contents for cell in value.__closure__ or ()]
        parts = [value.__code__, value.__defaults__, value.__kwdefaults__, cells]
        return [b"function", f"{value.__module__}:{value.__qualname__}".encode(),
                *self._each(parts, True)]  # fmt: skip

    def _code(self, value: types.CodeType) -> Iterable[bytes]:
        names = (value.co_names, value.co_varnames, value.co_freevars)
        return [b"code", value.co_code, *self._each([value.co_consts, names], True)]

    def _structure(self, value: Any, content: bool) -> Iterable[bytes]:
        """Describe a pytree by its children and what else it says, any other object by its fields.

        Only the children of a pytree are arguments; arrays in what else it says are built in.
        """
        name = _name(type(value))
        one_level = jax.tree_util.default_registry.flatten_one_level(value)
        if one_level is not None and not isinstance(value, eqx.Module):
            children, other = one_level
            return [name, *self._each(children, content), self.digest(other, True)]
        if isinstance(value, eqx.Module):
            return [
                name,
                *(
                    self.digest(vars(value).get(f.name), content or f.metadata.get("static", False))
                    for f in dataclasses.fields(value)  # pyright: ignore[reportArgumentType]
                ),
            ]
        if dataclasses.is_dataclass(value):
            told = [(f.name, getattr(value, f.name)) for f in dataclasses.fields(value)]
            # a name in a field may stand for code that is another user's
            if beside := getattr(value, "digest_beside_fields", ()):
                told.append(("digest_beside_fields", beside))
        elif hasattr(value, "__dict__"):
            told = sorted(vars(value).items())
        else:
            raise NotDescribable(f"an object of {type(value).__name__}")
        return [name, *(part for k, v in told for part in (k.encode(), self.digest(v, True)))]


def _hash(parts: Iterable[bytes]) -> bytes:
    total = hashlib.blake2b(digest_size=20)
    for part in parts:
        total.update(len(part).to_bytes(8, "little"))
        total.update(part)
    return total.digest()


def _require_known(module: str | None) -> None:
    """Refuse code of which no version says when it changes."""
    if (module or "").partition(".")[0] not in _VERSIONED:
        raise NotDescribable(f"code of {module}")


def _name(kind: type) -> bytes:
    _require_known(kind.__module__)
    if "<locals>" in kind.__qualname__:
        raise NotDescribable(f"the local class {kind.__qualname__}")
    return f"{kind.__module__}:{kind.__qualname__}".encode()


def found_by_name(value: Any) -> bytes | None:
    """Return the name by which a known package holds this very object; None if none does."""
    module, name = getattr(value, "__module__", None), getattr(value, "__qualname__", None)
    if not isinstance(module, str) or not isinstance(name, str):
        return None
    if module.partition(".")[0] not in _VERSIONED:
        return None
    found: Any = sys.modules.get(module)
    for part in name.split("."):
        found = getattr(found, part, None)
    return f"{module}:{name}".encode() if found is value else None
