"""Which kind of test determined each constant of a sparse law, and N1 in the flows fitted."""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np

from discover.dataset.run import Run
from discover.dataset.run_table import kind_of_record
from discover.learners.tensor_sindy.intervals import sensitivities_at
from discover.learners.tensor_sindy.refit import Fit
from discover.learners.tensor_sindy.search import SupportSearch
from discover.learners.trajectories.modulus_errors import modulus_columns
from discover.learners.trajectories.problem import TrajectoryProblem
from discover.learners.trajectories.sensitivities import observe
from discover.programs import compiled
from discover.protocols.kinematics import FOLLOWED
from discover.statistics import Sized, Told, told_by_tests

_OBSERVED = ("", ", N1", ", N2")
_observe = compiled(observe)


def told_by_kinds(search: SupportSearch, fit: Fit, runs: Sequence[Run]) -> tuple[Told, ...]:
    """Return what tests of each kind tell; nothing where all runs are of one kind."""
    problem = search.problem
    kinds = [kind_of_record(run) for run in runs]
    seen = np.any(problem.records.seen, axis=1)
    labels = [
        kind + _OBSERVED[k]
        for kind, of_run in zip(kinds, seen, strict=True)
        for k in np.flatnonzero(of_run)
    ]
    if len(set(labels)) < 2 or not fit.support:
        return ()
    residual, columns, inner = sensitivities_at(problem, fit)
    values = np.append(fit.coefficients, fit.inner[list(inner)])
    library = problem.library
    names = [f"coefficient of {library.names[i]}" for i in fit.support]
    names += [library.inner_names[i] for i in inner]
    least = np.finfo(float).tiny ** 0.5
    unit = np.eye(len(values))
    numbers = [
        Sized(name, unit[[i]] / max(abs(value), least))
        for i, (name, value) in enumerate(zip(names, values, strict=True))
    ]
    shared = None
    if np.any(np.asarray(problem.modulus_error)):
        slots = max(search.slots, len(fit.support))
        shared = modulus_columns(problem, fit.support, slots, fit.coefficients, fit.inner)
    numbers += _normal_stresses(problem, fit, inner, kinds, runs)
    return told_by_tests(columns, residual, problem.records.sequences(), labels, numbers, shared)


def _normal_stresses(
    problem: TrajectoryProblem, fit: Fit, inner: Sequence[int], kinds, runs
) -> list[Sized]:
    """Return N1 in the flows of each kind at a given rate."""
    followed = [run.protocol.control in FOLLOWED and run.protocol.flow == "shear" for run in runs]
    if not any(followed):
        return []
    active, of_terms = jnp.asarray(fit.support), jnp.asarray(fit.coefficients)
    value, slopes = _observe(problem, active, of_terms, jnp.asarray(fit.inner))
    n = len(fit.support)
    own = np.asarray(slopes)[:, :, 1][..., [*range(n), *(n + i for i in inner)]]
    first = np.asarray(value)[:, :, 1]
    found = []
    for kind in dict.fromkeys(kinds):
        at = [i for i, (k, f) in enumerate(zip(kinds, followed, strict=True)) if f and k == kind]
        if not at:
            continue
        size = np.sqrt(np.mean([np.mean(first[i, : len(runs[i])] ** 2) for i in at]))
        columns = np.concatenate([own[i, : len(runs[i])] for i in at])
        if size > 0.0 and np.all(np.isfinite(columns)):
            found.append(Sized(f"N1 in the {kind}, if this is the law", columns / size))
    return found
