"""Numbers that a caller gives, and results as plain JSON."""

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from math import isfinite
from typing import Any

import numpy as np

from discover.errors import InputError


def as_numbers(name: str, value: Any, finite: bool = True) -> np.ndarray:
    """Return real numbers, or sequences of them, as an array of any shape.

    Text, truth values and complex numbers are none. Raises InputError, which names `name`, if it or
    something in it is no such number, or not `finite`.
    """
    try:
        given = np.asarray(value)
        # NumPy reads "1" and True as numbers when it is asked for floats, and so hides a slip
        mixed = isinstance(value, list | tuple) and any(isinstance(one, bool) for one in value)
        kind = "" if mixed else given.dtype.kind
        real = kind in ("i", "u", "f") or (kind == "O" and _are_integers(given))
        numbers = given.astype(float) if real else None
    except (TypeError, ValueError, OverflowError):
        numbers = None
    if numbers is None or (finite and not np.all(np.isfinite(numbers))):
        kind = "finite numbers" if finite else "numbers"
        raise InputError(f"{name} must be {kind}; got {short(value)}.")
    return numbers


def as_number(name: str, value: Any) -> float:
    """Return one finite real number; raises `InputError` as `as_numbers` does."""
    numbers = as_numbers(name, value)
    if numbers.ndim:
        raise InputError(f"{name} must be one number; got {short(value)}.")
    return float(numbers)


def as_whole_number(name: str, value: Any, low: int = 0, high: int = 2**32 - 1) -> int:
    """Return one whole number within bounds; raises `InputError` for anything else."""
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not (whole and low <= value <= high):
        raise InputError(f"{name} must be a whole number from {low} to {high}; got {short(value)}.")
    return int(value)


def short(value: Any) -> str:
    """Return a value as a message can show it, in one short printable line."""
    text = ascii(value) if isinstance(value, str | bytes) else repr(value)
    text = " ".join(text.encode("utf-8", "backslashreplace").decode().split())
    return text if len(text) <= 60 else f"{text[:57]}..."


def _are_integers(given: np.ndarray) -> bool:
    """Return whether all are integers, which NumPy keeps as objects where they are huge."""
    return all(isinstance(one, int) and not isinstance(one, bool) for one in given.ravel())


_MOST_CONTAINERS, _MOST_VALUES = 1_000_000, 10_000_000
"""Of what a file holds: in memory a list of two bytes takes sixty."""


def plain(value: Any) -> Any:
    """Return a result as JSON has it: by its `to_json` if it has one, a dataclass by its fields."""
    if hasattr(value, "to_json"):
        return plain(value.to_json())
    if is_dataclass(value):
        return {one.name: plain(getattr(value, one.name)) for one in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, float) and not isfinite(value):
        return None
    return value if isinstance(value, str | int | float | bool | None) else str(value)


def json_text(content: Any) -> str:
    """Return the text of a file of results."""
    return json.dumps(content, indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def parse_json(content: bytes) -> Any:
    """Return what JSON of bounded size, depth and number of values holds, else raise ValueError."""
    containers, values = content.count(b"[") + content.count(b"{"), content.count(b",")
    if containers > _MOST_CONTAINERS or values > _MOST_VALUES:
        raise ValueError(f"more than {_MOST_CONTAINERS} lists or {_MOST_VALUES} values")
    try:
        return json.loads(content)
    except RecursionError:
        raise ValueError("nested too deeply") from None
