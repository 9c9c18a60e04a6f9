"""Results as JSON has them: lists, names and numbers, None for a number that is not finite."""

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from math import isfinite
from typing import Any

import numpy as np

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
    """Return what JSON of bounded size, depth and number of values holds.

    Raises
    ------
    ValueError
        If it is no JSON, nested too deeply, or holds more values than any result does.
    """
    containers, values = content.count(b"[") + content.count(b"{"), content.count(b",")
    if containers > _MOST_CONTAINERS or values > _MOST_VALUES:
        raise ValueError(f"more than {_MOST_CONTAINERS} lists or {_MOST_VALUES} values")
    try:
        return json.loads(content)
    except RecursionError:
        raise ValueError("nested too deeply") from None
