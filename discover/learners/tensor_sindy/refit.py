"""Refit of given supports without penalty: nonlinear least squares on integrated trajectories."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Bool, Float

from discover.learners.tensor_sindy.problem import TrajectoryProblem
from discover.learners.tensor_sindy.sensitivities import observe

LANES = 8
"""Supports refitted side by side: one compiled program serves any number of batches."""

_MAX_STEPS = 40
SCREENING = 1e-3
"""Relative tolerance that ranks candidates."""
POLISHING = 1e-9
"""Relative tolerance of reported coefficients."""

# The residual is scaled so that the solver's first damping, one, is small beside the curvature of
# a scaled parameter, which is of order one.
_AMPLIFICATION = 10.0
_RUNAWAY = 1e3  # relative misfit given to a trial that has no finite trajectory: always rejected


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


class _Lane(eqx.Module):
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


def _residual_and_jacobian(parameters, problem: TrajectoryProblem, lane: _Lane):
    q = lane.active.shape[0]
    scaled, free = parameters[:q], parameters[q:]
    inner, slope = jax.jvp(lambda u: inner_from_free(problem, u), (free,), (jnp.ones_like(free),))
    scale = jnp.where(lane.occupied, lane.scale, 0.0)
    predicted, sensitivity = observe(problem, lane.active, scale * scaled, inner)
    weight = _AMPLIFICATION * jnp.where(lane.keep[..., None], problem.weight, 0.0)
    seen = weight > 0
    residual = jnp.where(seen, weight * (predicted - problem.target), 0.0)
    columns = sensitivity * jnp.concatenate([scale, slope])
    columns = jnp.where(seen[..., None], weight[..., None] * columns, 0.0)
    sane = jnp.all(jnp.isfinite(residual)) & jnp.all(jnp.isfinite(columns))
    # A constant residual of runaway size is an increase, which the solver rejects.
    size = _AMPLIFICATION * _RUNAWAY / jnp.sqrt(1.0 * residual.size)
    everywhere = jnp.where(problem.weight > 0, problem.weight * predicted, 0.0)
    everywhere = jnp.where(sane, everywhere, size)
    residual = jnp.where(sane, residual, size)
    columns = jnp.where(sane, columns, 0.0)
    return residual.reshape(-1), columns.reshape(residual.size, -1), everywhere.reshape(-1)


@eqx.filter_custom_jvp
def _residual(parameters, problem, lane):
    residual, _, everywhere = _residual_and_jacobian(parameters, problem, lane)
    return residual, everywhere


@_residual.def_jvp
def _residual_jvp(primals, tangents):
    residual, jacobian, everywhere = _residual_and_jacobian(*primals)
    # the prediction is handed on beside the residual and never differentiated
    return (residual, everywhere), (jacobian @ tangents[0], jnp.zeros_like(everywhere))


@eqx.filter_jit
def _refit_lanes(
    problem: TrajectoryProblem,
    lanes: _Lane,
    start: Float[Array, "lanes parameters"],
    tolerance: Float[Array, ""],
):
    # a traced tolerance, so that screening and polishing share one program
    traced: Any = tolerance
    solver = optx.LevenbergMarquardt(rtol=traced, atol=traced)

    def one(lane, parameters):
        solution = optx.least_squares(
            lambda p, args: _residual(p, *args),
            solver,
            parameters,
            args=(problem, lane),
            has_aux=True,
            max_steps=_MAX_STEPS,
            throw=False,
        )
        return solution.value, solution.aux

    return jax.vmap(one)(lanes, start)


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
    fits: list[Fit] = []
    target = np.asarray(problem.weight * problem.target).reshape(-1)
    everything = np.ones(problem.target.shape[:2], dtype=bool)
    n_inner = len(problem.library.inner_names)
    for first in range(0, len(supports), LANES):
        batch = range(first, min(first + LANES, len(supports)))
        active = np.zeros((LANES, slots), dtype=int)
        occupied = np.zeros((LANES, slots), dtype=bool)
        keep = np.stack([everything] * LANES)
        start = np.zeros((LANES, slots + n_inner))
        for lane, i in enumerate(batch):
            support = list(supports[i])
            if len(support) > slots:
                raise ValueError(f"A support of {len(support)} terms does not fit {slots} slots.")
            coefficients, inner = starts[i]
            active[lane, : len(support)] = support
            occupied[lane, : len(support)] = True
            start[lane, : len(support)] = coefficients[support] / scale[support]
            start[lane, slots:] = free_from_inner(problem, inner)
            if keeps is not None:
                keep[lane] = keeps[i]
        lanes = _Lane(*(jnp.asarray(a) for a in (active, occupied, scale[active], keep)))
        parameters, predicted = _refit_lanes(
            problem, lanes, jnp.asarray(start), jnp.asarray(tolerance)
        )
        parameters, predicted = np.asarray(parameters), np.asarray(predicted)
        residual = predicted - target
        for lane, i in enumerate(batch):
            support = list(supports[i])
            coefficients = parameters[lane, : len(support)] * scale[support]
            inner = np.asarray(inner_from_free(problem, jnp.asarray(parameters[lane, slots:])))
            rows = np.repeat(keep[lane].reshape(-1), problem.target.shape[2])
            share = np.sum((np.asarray(problem.weight).reshape(-1) > 0) & rows)
            kept = float(np.sum(residual[lane][rows] ** 2)) * problem.n_observations / max(share, 1)
            fits.append(
                Fit(
                    tuple(int(j) for j in support),
                    coefficients,
                    inner,
                    float(np.sqrt(kept)),
                    predicted[lane],
                )
            )
    return fits
