"""Refit of given supports without penalty: nonlinear least squares on integrated trajectories."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from discover.inference.least_squares.tangents import RUNAWAY, bounded, descend
from discover.learners.trajectories.problem import TrajectoryProblem
from discover.learners.trajectories.sensitivities import observe
from discover.programs import compiled, in_threads, on_device
from discover.progress import require_wanted
from tensor_library.law_terms import LawTerms
from tensor_library.library import TermLibrary

_MAX_STEPS = 40
SCREENING = 1e-3
"""Relative tolerance that ranks candidates."""
POLISHING = 1e-9
"""Relative tolerance of reported coefficients."""


@dataclass(frozen=True)
class Fit:
    """A refitted support.

    Attributes
    ----------
    support
        Positions in the library, increasing.
    coefficients
        One for each position.
    inner
        Inner parameters of the whole library.
    misfit
        Relative root-mean-square misfit on the rows fitted.
    predicted
        Weighted prediction on all rows: its difference from another's is in units of misfit.
    """

    support: tuple[int, ...]
    coefficients: Float[np.ndarray, " q"]
    inner: Float[np.ndarray, " m"]
    misfit: float
    predicted: Float[np.ndarray, " rows"] = field(repr=False)

    def dense(self, n_terms: int) -> Float[np.ndarray, " n"]:
        """Return the coefficients of the whole library."""
        full = np.zeros(n_terms)
        full[list(self.support)] = self.coefficients
        return full

    def law(self, library: TermLibrary) -> LawTerms:
        """Return the terms of the support, with the inner parameters of their closed forms."""
        names = [library.names[i] for i in self.support]
        used = {library.terms[i].closed_form for i in self.support}
        inner = {
            form.inner_name: float(value)
            for form, value in zip(library.forms, self.inner, strict=True)
            if form.name in used
        }
        return LawTerms(dict(zip(names, map(float, self.coefficients), strict=True)), inner)


class _Layout(eqx.Module):
    """One support, laid out with as many slots as the largest one."""

    active: Array  # (q,)
    occupied: Array  # (q,) bool
    scale: Array  # (q,)
    keep: Array  # (runs, n) bool


def inner_from_free(problem: TrajectoryProblem, free: Float[Array, " m"]) -> Float[Array, " m"]:
    """Return inner parameters inside their bounds from unbounded ones."""
    if not problem.library.inner_names:
        return free
    low, high = (jnp.asarray(b) for b in zip(*problem.library.inner_bounds, strict=True))
    return low + (high - low) * jax.nn.sigmoid(free)


def free_from_inner(problem: TrajectoryProblem, inner: Float[np.ndarray, " m"]) -> np.ndarray:
    """Return the unbounded parameters of inner ones."""
    if not problem.library.inner_names:
        return np.asarray(inner, dtype=float)
    low, high = (np.asarray(b) for b in zip(*problem.library.inner_bounds, strict=True))
    fraction = np.clip((np.asarray(inner) - low) / (high - low), 1e-6, 1.0 - 1e-6)
    return np.log(fraction / (1.0 - fraction))


def _linearise(parameters, args: tuple[TrajectoryProblem, _Layout]):
    """Return residual and derivatives of scaled parameters, and the prediction of all records."""
    problem, layout = args
    q = layout.active.shape[0]
    scaled, free = parameters[:q], parameters[q:]
    inner, slope = jax.jvp(lambda u: inner_from_free(problem, u), (free,), (jnp.ones_like(free),))
    scale = jnp.where(layout.occupied, layout.scale, 0.0)
    predicted, sensitivity = observe(problem, layout.active, scale * scaled, inner)
    columns = sensitivity * jnp.concatenate([scale, slope])
    residual, columns, sane = bounded(
        *problem.records.only(layout.keep).linearised(predicted, columns)
    )
    everywhere = jnp.where(sane, problem.records.weighted(predicted), residual)
    return residual.reshape(-1), columns.reshape(residual.size, -1), everywhere.reshape(-1)


@compiled
def _descend(
    problem: TrajectoryProblem,
    layout: _Layout,
    start: Float[Array, " parameters"],
    tolerance: Float[Array, ""],
):
    return descend(_linearise, start, (problem, layout), tolerance, _MAX_STEPS)


def _lay_out(problem: TrajectoryProblem, support, begin, scale, slots: int, keep):
    """Return a support in its slots, and the scaled parameters from which its fit starts."""
    places, count = list(support), len(support)
    if count > slots:
        raise ValueError(f"A support of {count} terms does not fit {slots} slots.")
    coefficients, inner = begin
    active = np.zeros(slots, dtype=int)
    start = np.zeros(slots + len(problem.library.inner_names))
    active[:count] = places
    start[:count] = coefficients[places] / scale[places]
    start[slots:] = free_from_inner(problem, inner)
    arrays = (active, np.arange(slots) < count, scale[active], keep)
    return _Layout(*(on_device(a) for a in arrays)), on_device(start)


def sum_of_squares(apart: Float[np.ndarray, " rows"]) -> float:
    """Return the sum of squares of relative misfits, of a law that ran away as of one at the limit.

    A law may end finite and yet too large to be squared.
    """
    return float(np.sum(np.clip(apart, -RUNAWAY, RUNAWAY) ** 2))


def refit(
    problem: TrajectoryProblem,
    supports: Sequence[tuple[int, ...]],
    starts: Sequence[tuple[Float[np.ndarray, " n"], Float[np.ndarray, " m"]]],
    scale: Float[np.ndarray, " n"],
    slots: int,
    keeps: Sequence[Bool[np.ndarray, "runs samples"]] | None = None,
    tolerance: float = POLISHING,
) -> list[Fit]:
    """Return the least-squares fits of several supports by Levenberg–Marquardt.

    Parameters
    ----------
    problem
        Data, known physics and library.
    supports
        Positions of the terms of each; at most `slots`.
    starts
        Coefficients of the whole library, and inner parameters, from which each fit starts.
    scale
        Typical size of each coefficient, for conditioning.
    slots
        Largest size of a support; sets the shape of the compiled program.
    keeps
        For each, which samples to fit, shape (runs, samples); all by default.
    tolerance
        Relative tolerance of the solver.

    Returns
    -------
    One `Fit` each. A support whose start has no finite trajectory comes back with a misfit of
    about 1000, which no search accepts.
    """
    require_wanted()
    target = problem.records.weighted_record
    observed = problem.records.seen.reshape(-1)

    def one(support, begin, keep) -> Fit:
        places, count = list(support), len(support)
        layout, start = _lay_out(problem, support, begin, scale, slots, keep)
        parameters, predicted = _descend(problem, layout, start, jnp.asarray(tolerance))
        parameters, predicted = np.asarray(parameters), np.asarray(predicted)
        rows = np.repeat(keep.reshape(-1), problem.records.recorded.shape[2])
        kept = sum_of_squares((predicted - target)[rows])
        share = problem.records.n_observations / max(np.sum(observed & rows), 1)
        return Fit(
            tuple(int(i) for i in support),
            parameters[:count] * scale[places],
            np.asarray(inner_from_free(problem, jnp.asarray(parameters[slots:]))),
            float(np.sqrt(kept * share)),
            predicted,
        )

    everything = np.ones(problem.records.recorded.shape[:2], dtype=bool)
    keeps = [everything] * len(supports) if keeps is None else keeps
    jobs = list(zip(supports, starts, keeps, strict=True))
    # one support to a program: a batch of them by `vmap` takes as many steps as its slowest member,
    # two to three times the work
    return in_threads(lambda job: one(*job), jobs)
