"""Settings of estimators, checked when they fit."""

from collections.abc import Mapping, Sequence
from numbers import Integral
from typing import Any

import jax
import numpy as np
from jaxtyping import Float

from discover.errors import InputError
from discover.progress import checked
from tensor_library.library import TermLibrary, build_library

PerMode = float | int | Sequence[float] | np.ndarray | jax.Array
"""A number, or one value for each relaxation mode, shape (k,)."""

_WHOLE = {"max_terms": 1, "n_members": 1, "random_state": 0}
"""Settings that are whole numbers, with the least that each may be."""

ARITHMETIC = 1e-5
"""Relative misfit that both integrations together may leave: the floor of the sparse search."""

DEFAULT_DEGREE = 1
"""Degree in the invariants of the terms that are searched where nobody names others."""


def check_settings(settings: Mapping[str, Any]) -> None:
    """Raise InputError if a count or seed is no whole number, or `progress` cannot be called."""
    for name, least in _WHOLE.items():
        value = settings.get(name)
        if value is None:
            continue  # not a setting of this one, or any seed
        if isinstance(value, bool) or not isinstance(value, Integral) or value < least:
            raise InputError(f"{name} must be a whole number, at least {least}; got {value!r}.")
    checked(settings.get("progress"))


def per_mode(name: str, value: PerMode) -> Float[np.ndarray, " k"]:
    """Return a setting with one value for each mode.

    Raises InputError if a value is no number, or is not positive and finite.
    """
    values = np.atleast_1d(np.asarray(value))
    numbers = values.dtype.kind in "iuf" and values.ndim == 1 and values.size
    if not numbers or not np.all((values > 0) & np.isfinite(values)):
        raise InputError(
            f"{name} must be positive and finite, a number or one for each mode; got {value!r}."
        )
    return values.astype(float)


def default_library() -> TermLibrary:
    """Return the terms that are searched where nobody names others."""
    return build_library(degree=DEFAULT_DEGREE)


def check_library(library: TermLibrary | None) -> None:
    """Refuse what is no library of terms."""
    if library is not None and not isinstance(library, TermLibrary):
        raise InputError(
            "library must be a TermLibrary; got a "
            f"{type(library).__name__}. Use tensor_library.build_library."
        )
