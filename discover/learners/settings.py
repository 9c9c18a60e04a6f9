"""What estimators are given: settings, and the known part of the fluid; checked in `fit`."""

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any

import jax
import numpy as np
from jaxtyping import Float

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


_HELD_BY_BASE = (
    "modulus",
    "relaxation_time",
    "solvent_viscosity",
    "base_law",
    "known_relaxation",
    "modulus_covariance",
)


@dataclass(frozen=True)
class KnownPart:
    """Known fluid, to which a learner adds terms.

    `law`: dimensionless; None for upper convected Maxwell. `modulus`, `relaxation_time`: in Pa and
    s, shape (k,). `modulus_covariance`: in Pa², shape (k, k); None where the moduli are exact.
    """

    law: AbstractConstitutiveLaw | None
    modulus: Float[np.ndarray, " k"]
    relaxation_time: Float[np.ndarray, " k"]
    solvent_viscosity: float  # in Pa s
    linear_relaxation: bool  # whether −σ is known
    modulus_covariance: Float[np.ndarray, "c c"] | None = None

    @property
    def fluid(self) -> Fluid:
        """The known part alone, as a fluid."""
        law = UpperConvectedMaxwell(self.linear_relaxation) if self.law is None else self.law
        return Fluid(law, self.modulus, self.relaxation_time, self.solvent_viscosity)


def known_part(estimator: Any) -> KnownPart:
    """Return what an estimator is told of the fluid: by `base`, or part by part.

    Raises InputError if `base` is no fluid, something that it holds is given too, or a part is
    unusable.
    """
    base = estimator.base
    if base is None:
        law = estimator.base_law
        if not (law is None or isinstance(law, AbstractConstitutiveLaw)):
            raise InputError(
                f"base_law must be a law, such as make_law('ucm'); got a {type(law).__name__}."
            )
        if law is not None:
            check_law(law)
        modulus = per_mode("modulus", estimator.modulus)
        relaxation_time = per_mode("relaxation_time", estimator.relaxation_time)
        if modulus.shape != relaxation_time.shape:
            raise InputError(
                "modulus and relaxation_time must have one value for each mode; got "
                f"{modulus.size} and {relaxation_time.size}."
            )
        viscosity = getattr(estimator, "solvent_viscosity", 0.0)
        if not (isinstance(viscosity, Real) and 0.0 <= float(viscosity) < np.inf):
            raise InputError(
                f"solvent_viscosity must be a number in Pa s, not negative; got {viscosity!r}."
            )
        return KnownPart(
            law,
            modulus,
            relaxation_time,
            float(viscosity),
            estimator.known_relaxation if law is None else law.linear_relaxation,
            getattr(estimator, "modulus_covariance", None),
        )
    if not isinstance(base, Fluid):
        raise InputError(
            f"base must be a Fluid; got a {type(base).__name__}. Make one with "
            "Fluid(law, modulus, relaxation_time) or Fluid.from_sweep(data.linear_sweep)."
        )
    defaults = inspect.signature(type(estimator).__init__).parameters
    for name in _HELD_BY_BASE:
        if name in defaults and not _same(getattr(estimator, name), defaults[name].default):
            raise InputError(f"base holds {name} already; got both. Leave {name} out, or base.")
    check_law(base.law)
    return KnownPart(
        None if isinstance(base.law, UpperConvectedMaxwell) else base.law,
        np.asarray(base.modulus),
        np.asarray(base.relaxation_time),
        float(base.solvent_viscosity),
        base.law.linear_relaxation,
        None if base.modulus_covariance is None else np.asarray(base.modulus_covariance),
    )


def _same(value: Any, default: Any) -> bool:
    return value is default or (np.ndim(value) == 0 and bool(value == default))


def require_known_rate(known: KnownPart, runs: Sequence[Run]) -> None:
    """Refuse runs without a rate beside a known law that carries more than its stress."""
    if known.law is None or not (known.law.variables or known.law.retracts):
        return
    for run in runs:
        if run.protocol.control not in FOLLOWED:
            raise InputError(
                f"The run {run.name!r} has no known shear rate, and a learner cannot solve for "
                f"it with {type(known.law).__name__}, which has variables besides the "
                "stress. Leave the run out, or use close_loop, which takes it."
            )
