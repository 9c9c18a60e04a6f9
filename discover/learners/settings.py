"""What estimators are given: settings, and the known part of the fluid; checked in `fit`."""

import inspect
from collections.abc import Mapping, Sequence
from numbers import Integral
from typing import Any

import jax
import numpy as np

from discover.dataset.run import Run
from discover.errors import InputError
from discover.laws import AbstractConstitutiveLaw, Fluid, UpperConvectedMaxwell
from discover.laws.registry import check_law
from discover.progress import checked
from discover.protocols.kinematics import FOLLOWED
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


_HELD_BY_BASE = (
    "modulus",
    "relaxation_time",
    "solvent_viscosity",
    "base_law",
    "known_relaxation",
    "modulus_covariance",
)


def known_part(estimator: Any) -> Fluid:
    """Return the known fluid to which an estimator adds terms: its `base`, or part by part.

    Raises InputError if `base` is no fluid, something that it holds is given too, or a part is
    unusable.
    """
    base = estimator.base
    if base is None:
        law = estimator.base_law
        base = Fluid(
            UpperConvectedMaxwell(estimator.known_relaxation) if law is None else law,
            estimator.modulus,
            estimator.relaxation_time,
            estimator.solvent_viscosity,
            getattr(estimator, "modulus_covariance", None),
        )
    elif not isinstance(base, Fluid):
        raise InputError(
            f"base must be a Fluid; got a {type(base).__name__}. Make one with "
            "Fluid(law, modulus, relaxation_time) or Fluid.from_sweep(data.linear_sweep)."
        )
    else:
        defaults = inspect.signature(type(estimator).__init__).parameters
        for name in _HELD_BY_BASE:
            if name in defaults and not _same(getattr(estimator, name), defaults[name].default):
                raise InputError(f"base holds {name} already; got both. Leave {name} out, or base.")
    check_law(base.law)
    return base


def law_below(known: Fluid) -> AbstractConstitutiveLaw | None:
    """Return the law to whose h a learner adds; None where that is zero, so that programs serve."""
    return None if isinstance(known.law, UpperConvectedMaxwell) else known.law


def _same(value: Any, default: Any) -> bool:
    return value is default or (np.ndim(value) == 0 and bool(value == default))


def require_known_rate(known: Fluid, runs: Sequence[Run]) -> None:
    """Refuse runs without a rate beside a known law that carries more than its stress."""
    if not (known.law.variables or known.law.retracts):
        return
    for run in runs:
        if run.protocol.control not in FOLLOWED:
            raise InputError(
                f"The run {run.name!r} has no known shear rate, and a learner cannot solve for "
                f"it with {type(known.law).__name__}, which has variables besides the "
                "stress. Leave the run out, or use close_loop, which takes it."
            )
