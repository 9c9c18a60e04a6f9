"""Coefficients of a whole library given data: the mode of the posterior, and what it leaves open.

With c = s z, s a typical size of each coefficient, the prior is z ~ N(0, κ²) about a reference
law and the noise of n independent records has the relative size σ, so that the mode minimises
n |r(z)|²/σ² + |z|²/κ². Width and noise follow from the evidence   [MacKay 1992, Neural Comput. 4,
415].
"""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from discover.inference.least_squares.tangents import bounded, descend
from discover.learners.trajectories.problem import TrajectoryProblem
from discover.learners.trajectories.sensitivities import observe
from discover.programs import compiled

_MOST_STEPS = 12
_TOLERANCE = 1e-2
"""Of a mode, in widths of the prior: draws scatter by far more."""


class _Layout(eqx.Module):
    """What one descent is about; traced, so that all share a program."""

    problem: TrajectoryProblem
    scale: Array  # (n,) times the width of the prior
    precision: Array  # √n/σ


def _linearise(unit, layout: _Layout):
    """Return residuals of data and prior with their derivatives, and those of the data alone."""
    problem = layout.problem
    everything = jnp.arange(unit.shape[0])
    predicted, sensitivity = observe(problem, everything, layout.scale * unit, jnp.zeros(0))
    residual, columns = problem.records.linearised(predicted, sensitivity)
    residual, columns, _ = bounded(residual, columns * layout.scale)
    residual, columns = residual.reshape(-1), columns.reshape(residual.size, -1)
    rows = jnp.concatenate([layout.precision * residual, unit])
    slopes = jnp.concatenate([layout.precision * columns, jnp.eye(unit.size)])
    return rows, slopes, (residual, columns)


@compiled
def _descend(layout: _Layout, start: Float[Array, " n"]):
    return descend(_linearise, start, layout, _TOLERANCE, _MOST_STEPS)


def mode(
    problem: TrajectoryProblem,
    scale: Float[np.ndarray, " n"],
    width: float,
    noise: float,
    records: float,
    start: Float[np.ndarray, " n"],
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " rows"], Float[np.ndarray, "rows n"]]:
    """Return the mode of the posterior, the residual there, and its derivatives.

    Parameters
    ----------
    problem
        Data, and the reference law as known law.
    scale
        Typical size of each coefficient.
    width
        κ of the prior.
    noise
        Relative noise σ.
    records
        Number of independent records n.
    start
        Scaled coefficients z from which to descend.

    Returns
    -------
    z, prediction minus data in units of the relative misfit, and its derivatives with respect to z.
    """
    layout = _Layout(problem, jnp.asarray(scale * width), jnp.asarray(np.sqrt(records) / noise))
    found: Any = _descend(layout, jnp.asarray(start / width))
    unit, (residual, columns) = found
    return np.asarray(unit) * width, np.asarray(residual), np.asarray(columns) / width


def log_evidence(
    misfit: float,
    coefficients: Float[np.ndarray, " n"],
    columns: Float[np.ndarray, "rows n"],
    width: float,
    noise: float,
    records: float,
) -> float:
    """Return the logarithm of the evidence of a width, by Laplace, up to a constant of the noise.

    Parameters
    ----------
    misfit
        Norm of the residual at the mode.
    coefficients, columns
        z and the derivatives at the mode.
    width, noise, records
        As in `mode`.
    """
    curvature = _curvatures(columns, noise, records)
    fit = records * misfit**2 / noise**2 + np.sum(coefficients**2) / width**2
    return float(-0.5 * (fit + np.sum(np.log1p(curvature * width**2))))


def most_evident(
    residual: Float[np.ndarray, " rows"],
    coefficients: Float[np.ndarray, " n"],
    columns: Float[np.ndarray, "rows n"],
    width: float,
    noise: float,
    records: float,
) -> tuple[float, float]:
    """Return width and noise after one of MacKay's updates, at which both repeat themselves.

    κ² = |z|²/γ and σ² = n |r|²/(n − γ), with γ the number of coefficients that the data determine
    [MacKay 1992, Neural Comput. 4, 415, eqs. 4.8 and 4.9].

    Parameters as in `log_evidence`, with the residual itself.
    """
    curvature = _curvatures(columns, noise, records)
    determined = float(np.sum(curvature / (curvature + width**-2.0)))
    left = max(records - determined, 1.0)
    smallest = np.finfo(float).tiny
    return (
        float(np.sqrt(np.sum(coefficients**2) / max(determined, smallest))),
        float(np.sqrt(records * np.sum(residual**2) / left)),
    )


def spread(
    columns: Float[np.ndarray, "rows n"], width: float, noise: float, records: float
) -> tuple[Float[np.ndarray, "n n"], Float[np.ndarray, "n n"]]:
    """Return a root R of the covariance of z at a mode, R Rᵀ = (SᵀS n/σ² + 1/κ²)⁻¹, and R⁻¹.

    Parameters as in `log_evidence`.
    """
    # in widths of the prior no eigenvalue is below one, however alike two terms are
    precision = columns.T @ columns * (records * width**2 / noise**2) + np.eye(columns.shape[1])
    values, vectors = np.linalg.eigh(precision)
    roots = np.sqrt(np.maximum(values, 1.0))
    return width * vectors / roots, (vectors * roots).T / width


def _curvatures(columns, noise: float, records: float) -> Float[np.ndarray, " n"]:
    values = np.linalg.eigvalsh(columns.T @ columns)
    return np.clip(values, 0.0, None) * (records / noise**2)
