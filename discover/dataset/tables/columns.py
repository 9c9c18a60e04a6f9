"""Columns of numbers that a program hands over: lists, arrays or series, as arrays of float64."""

import numpy as np
from jaxtyping import Float

from discover.errors import InputError


def as_column(values: object, label: str) -> Float[np.ndarray, " n"]:
    """Return finite numbers as an array of shape (n,).

    `values`: A list, an array or a pandas series. `label`: what they are, for messages. Raises
    InputError if they have a unit of their own, are not numbers, not finite, or of another shape.
    """
    if hasattr(values, "magnitude"):
        raise InputError(
            f"{label} carries a unit; got a {type(values).__name__}. Give plain "
            "numbers in SI units."
        )
    try:
        given = np.asarray(values)
        # pandas marks what is missing in columns of objects
        numbers = given.astype(float) if given.dtype.kind in "iufO" else None
    except (TypeError, ValueError, OverflowError):
        numbers = None
    if numbers is None or numbers.ndim != 1:
        raise InputError(f"{label} must be a list or an array of numbers; got {_shown(values)}.")
    if not np.all(np.isfinite(numbers)):
        row = int(np.argmin(np.isfinite(numbers)))
        raise InputError(
            f"{label} must be finite; sample {row} holds {numbers[row]}. Remove that sample."
        )
    return numbers


def _shown(values: object) -> str:
    shape = getattr(values, "shape", None)
    if shape:
        return f"an array of shape {shape} of {getattr(values, 'dtype', 'unknown type')}"
    text = repr(values)
    return text if len(text) <= 60 else f"{text[:60]}…"
