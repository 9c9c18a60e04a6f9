"""What a program is made from, as a digest that means the same in every process.

A program depends on its arguments' shapes and on everything about them that is no array: classes,
options, functions with what they enclose. Whatever cannot be described exactly is refused, so that
two different programs never share a digest; objects are never told by their address or `repr`.
"""

import dataclasses
import enum
import hashlib
import sys
import types
from collections.abc import Iterable
from functools import partial
from typing import Any

import equinox as eqx
import jax
import numpy as np

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
    """Return a digest of a value.

    `value`: arguments of a function, or the function. `arrays_by_content`: whether an array counts
    with its numbers, as it does where they are built into a program, or with its shape and type
    only, as it does for an argument. Raises NotDescribable if the value holds what cannot be
    described: code outside the packages known by version, an object that refers to itself, a
    device's handle.
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
