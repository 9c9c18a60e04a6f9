"""The nesting of a program's results, written as JSON and built again without running it."""

import dataclasses
import importlib
from collections.abc import Iterator, Sequence
from typing import Any

import equinox as eqx

from discover.programs.fingerprint import OURS, NotDescribable

_PLAIN = (type(None), bool, int, float, str)


def take_apart(value: Any, leaves: list[Any]) -> Any:
    """Return the nesting of a value as JSON-able lists, and append its arrays to `leaves`.

    Raises NotDescribable if it holds something other than arrays, plain values, tuples, lists,
    dictionaries and the named tuples and modules of this project.
    """
    if eqx.is_array(value):
        leaves.append(value)
        return ["array"]
    if isinstance(value, _PLAIN):
        return ["plain", value]
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return ["named", _name(type(value)), *(take_apart(part, leaves) for part in value)]
    if type(value) in (tuple, list):
        return [type(value).__name__, *(take_apart(part, leaves) for part in value)]
    if type(value) is dict and all(isinstance(key, str) for key in value):
        return ["dict", *([key, take_apart(part, leaves)] for key, part in value.items())]
    if isinstance(value, eqx.Module):
        fields = [f.name for f in dataclasses.fields(value)]  # pyright: ignore[reportArgumentType]
        parts = [[name, take_apart(vars(value)[name], leaves)] for name in fields]
        return ["module", _name(type(value)), *parts]
    raise NotDescribable(f"a result of {type(value).__name__}")


def put_together(nesting: Sequence[Any], leaves: Iterator[Any]) -> Any:
    """Return the value with this nesting and these arrays, in the order of `take_apart`."""
    kind, *parts = nesting
    if kind == "array":
        return next(leaves)
    if kind == "plain":
        return parts[0]
    if kind in ("tuple", "list"):
        values = (put_together(part, leaves) for part in parts)
        return tuple(values) if kind == "tuple" else list(values)
    if kind == "dict":
        return {key: put_together(part, leaves) for key, part in parts}
    name, *parts = parts
    made = _class(name)
    if kind == "named":
        return made(*(put_together(part, leaves) for part in parts))
    # as equinox itself rebuilds a module: without its __init__, which may compute
    module = object.__new__(made)
    for key, part in parts:
        object.__setattr__(module, key, put_together(part, leaves))
    return module


def _name(kind: type) -> str:
    if kind.__module__.partition(".")[0] not in OURS or "." in kind.__qualname__:
        raise NotDescribable(f"a result of {kind.__name__}")
    return f"{kind.__module__}:{kind.__qualname__}"


def _class(name: str) -> Any:
    module, _, kind = name.partition(":")
    if module.partition(".")[0] not in OURS:
        raise NotDescribable(f"a class of {module}")
    found = getattr(importlib.import_module(module), kind)
    if not (isinstance(found, type) and issubclass(found, (tuple, eqx.Module))):
        raise NotDescribable(f"{name} is no result")
    return found
