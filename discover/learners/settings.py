"""What estimators are given: settings, the known part of the fluid, runs; checked in `fit`."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from numbers import Integral
from typing import Any

import numpy as np
from jaxtyping import ArrayLike

from discover.dataset.material_functions import as_compared
from discover.dataset.run import Run, require_later_samples
from discover.errors import InputError
from discover.first_use import require_double
from discover.laws import AbstractConstitutiveLaw, Fluid, UpperConvectedMaxwell
from discover.laws.registry import check_law
from discover.progress import checked
from discover.protocols import settled
from discover.protocols.kinematics import FOLLOWED
from tensor_library.library import TermLibrary, build_library

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


def known_part(base: Any) -> Fluid:
    """Return the known fluid to which an estimator adds terms: UCM of 1 Pa and 1 s where None is.

    Raises InputError if `base` is no fluid, or its law cannot be computed.
    """
    base = Fluid() if base is None else base
    if not isinstance(base, Fluid):
        raise InputError(
            f"base must be a Fluid; got a {type(base).__name__}. Make one with "
            "Fluid(law, modulus, relaxation_time) or Fluid.from_sweep(data.linear_sweep)."
        )
    check_law(base.law)
    return base


def law_below(known: Fluid) -> AbstractConstitutiveLaw | None:
    """Return the law to whose h a learner adds; None where that is zero, so that programs serve."""
    return None if isinstance(known.law, UpperConvectedMaxwell) else known.law


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


_MAKE = "Load a folder with load_dataset, or make a data set of a table with from_dataframe."


def as_runs(
    runs: Iterable[Run], relaxation_time: ArrayLike = 0.0, relaxes: bool = True
) -> list[Run]:
    """Return the runs as a list, each as `as_compared` has it.

    `relaxation_time`: of the modes, in s. `relaxes`: whether the fluid is known to relax, so that a
    periodic start is solved for; otherwise, or at a given stress, cycles are put before the run.
    Raises InputError if there is no run, one is something else, a mode is too slow, or JAX computes
    in single precision.
    """
    require_double()
    if isinstance(runs, Run):
        raise InputError(
            f"A learner takes several runs; got the single run {runs.name!r}. Put it in a list: "
            "fit([run])."
        )
    if isinstance(runs, str) or not isinstance(runs, Iterable):
        raise InputError(
            f"A learner takes a data set or a sequence of Run; got a {type(runs).__name__}. {_MAKE}"
        )
    listed = list(runs)
    if not listed:
        raise InputError("A learner needs at least one run; got none.")
    for run in listed:
        if not isinstance(run, Run):
            raise InputError(
                f"A learner takes a data set or a sequence of Run; got a {type(runs).__name__} "
                f"that holds a {type(run).__name__}. {_MAKE}"
            )
    require_later_samples(listed)
    longest = float(np.max(np.asarray(relaxation_time)))
    return [waiting(run, longest, relaxes) for run in as_compared(listed)]


def waiting(run: Run, relaxation_time: float, relaxes: bool) -> Run:
    """Return a run with the cycles before it to wait for, if its state is not solved for."""
    if relaxes and run.protocol.control == "rate":
        return run
    return replace(run, protocol=settled(run.protocol, relaxation_time))


def require_signal(runs: Sequence[Run]) -> None:
    """Refuse runs whose record is zero throughout."""
    for run in runs:
        if not np.any(run.recorded):
            raise InputError(
                f"The shear stress of the run {run.name!r} is zero throughout: it says nothing of "
                "the law. Leave the run out."
            )
