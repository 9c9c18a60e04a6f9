"""Least squares of many small problems that share one model, and how far parameters may be off.

By Levenberg–Marquardt; uncertain by curvature, noise and moduli.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.optimize import lsq_linear

from discover.dataset import Run
from discover.forward import AugmentedModel, Batch, Linearised, Point, linearised
from discover.protocols.between_samples import sampling_interval
from discover.statistics import (
    LackOfFit,
    NoiseModel,
    lack_of_fit,
    least_squares_covariance,
    root_of,
)
from discover.statistics.residual import Expectation

_DAMPINGS = (0.1, 1.0, 10.0)
"""Multiples of a problem's damping that are tried side by side."""

_LARGEST_DAMPING, _LEAST_DAMPING = 1e7, 1e-8
_FREE = 1.0
"""Damping, relative to the curvature, below which a step is the problem's own."""


@dataclass
class Fit:
    """A fitted parameter vector.

    `free`: positions of the fitted ones. `residual`: weighted residuals, shape (runs, n).
    `jacobian`: their derivatives in the fitted parameters, shape (free, runs, n). `damping`,
    `done`: of the descent that leads here.
    """

    theta: Float[np.ndarray, " p"]
    free: tuple[int, ...]
    residual: Float[np.ndarray, "runs n"]
    jacobian: Float[np.ndarray, "free runs n"]
    damping: float = 1e-2
    done: bool = False

    @property
    def cost(self) -> float:
        """Sum over runs of the squared relative errors."""
        with np.errstate(over="ignore", invalid="ignore"):  # of what ran away
            return float(np.sum(self.residual**2))

    @property
    def usable(self) -> bool:
        """Whether residuals and derivatives are all finite."""
        return bool(np.all(np.isfinite(self.residual)) and np.all(np.isfinite(self.jacobian)))


def best_of(fits: Iterable[Fit]) -> Fit | None:
    """Return the usable fit of the least cost; None where none is usable."""
    return min((fit for fit in fits if fit.usable), key=lambda fit: fit.cost, default=None)


def fit_batch(
    model: AugmentedModel,
    batch: Batch,
    starts: Sequence[np.ndarray],
    free: Sequence[Sequence[int]],
    max_steps: int = 100,
    tolerance: float = 1e-5,
) -> list[Fit]:
    """Minimise the squared residuals from several starts, each in its own free parameters.

    All problems advance together: one call predicts the steps of all with several dampings, and one
    more the derivatives where they end, by differences. A residual costs so little beside a
    compilation of its derivative that this is several times faster here. A trial that cannot be
    integrated is a rejected step. A step is the best that the ranges of the parameters hold, so the
    others go on where one is at its bound   [Kanzow, Yamashita & Fukushima 2004, J. Comput. Appl.
    Math. 172, 375].

    `model`, `batch`: what is fitted, to what. `starts`, `free`: a parameter vector and the
    positions of its free parameters, for each problem. `max_steps`: largest number of steps.
    `tolerance`: a problem is finished when a step lowers its cost by less than this fraction.
    """
    given = [
        Point(np.array(start, dtype=float), tuple(at))
        for start, at in zip(starts, free, strict=True)
    ]
    fits = [
        Fit(point.theta, tuple(point.positions), found.residual, found.jacobian)
        for point, found in zip(given, linearised(model, given, batch), strict=True)
    ]
    going = [fit for fit in fits if fit.free and np.isfinite(fit.cost)]
    for _ in range(max_steps):
        if not going:
            break
        tried = [_trial(model, fit, multiple) for fit in going for multiple in _DAMPINGS]
        found = linearised(model, tried, batch)
        n = len(_DAMPINGS)
        moved = [
            fit
            for i, fit in enumerate(going)
            if _take(fit, tried[n * i : n * (i + 1)], found[n * i : n * (i + 1)], tolerance)
        ]
        points = [Point(fit.theta, fit.free, fit.residual) for fit in moved]
        for fit, at in zip(moved, linearised(model, points, batch) if moved else (), strict=True):
            fit.jacobian = at.jacobian
        going = [fit for fit in going if not fit.done]
    return fits


def _trial(model: AugmentedModel, fit: Fit, multiple: float) -> Point:
    """Return parameters after the best damped step that the ranges of what is free hold."""
    at, theta = list(fit.free), fit.theta.copy()
    design = fit.jacobian.reshape(len(at), -1).T
    if np.all(np.isfinite(design)):
        scale = np.linalg.norm(design, axis=0)
        scale = np.where(scale > 0, scale, 1.0)
        damping = np.sqrt(multiple * fit.damping) * np.eye(len(at))
        padded = np.concatenate([design / scale, damping])
        target = np.concatenate([-fit.residual.ravel(), np.zeros(len(at))])
        step = np.linalg.lstsq(padded, target, rcond=None)[0]
        low, high = scale * (model.low[at] - theta[at]), scale * (model.high[at] - theta[at])
        if np.any((step < low) | (step > high)):
            high = np.maximum(high, np.nextafter(low, np.inf))  # a range may be one value
            step = lsq_linear(padded, target, (low, high), method="bvls").x
        theta[at] = np.clip(theta[at] + step / scale, model.low[at], model.high[at])
    return Point(theta, limit=fit.cost)


def _take(fit: Fit, tried: Sequence[Point], found: Sequence[Linearised], tolerance: float) -> bool:
    """Take the best of some trials, if one is better; return whether one was."""
    before = fit.cost
    with np.errstate(over="ignore", invalid="ignore"):  # of what ran away
        costs = np.array([np.sum(one.residual**2) for one in found])
    best = int(np.argmin(np.where(np.isfinite(costs), costs, np.inf)))
    if not costs[best] < before:
        fit.damping *= 1e2
        fit.done = fit.damping > _LARGEST_DAMPING
        return False
    fit.theta, fit.residual = tried[best].theta, found[best].residual
    fit.damping = max(_DAMPINGS[best] * fit.damping, _LEAST_DAMPING)
    # a step that damping cut short gains little anywhere
    fit.done = fit.damping < _FREE and 1.0 - costs[best] / before < tolerance
    return True


_SHIFT = 0.1
"""Standard deviations by which moduli are moved; what a rate controls is linear in them."""


def uncertainty(
    model: AugmentedModel, batch: Batch, fit: Fit
) -> tuple[Float[np.ndarray, "free free"], float]:
    """Return covariance and degrees of freedom of a fit, errors of the moduli included.

    From the curvature at the fit and the noise that its residual shows; see
    `discover.statistics.least_squares_covariance`.
    """
    if not fit.free:
        return np.zeros((0, 0)), 1.0
    covariance, noise = _covariance_and_noise(batch, fit.residual, fit.jacobian)
    shifts = modulus_shifts(model, fit.theta, batch)
    if len(shifts):
        off = _response(fit.jacobian, shifts)
        covariance = covariance + off @ off.T
    return covariance, max(noise.effective_samples - len(fit.free), 1.0)


def what_is_left(
    fit: Fit, batch: Batch, runs: Sequence[Run], expectation: Expectation
) -> LackOfFit:
    """Return whether what a fit leaves of the runs is noise.

    `fit`, `batch`, `runs`: the fit, and the runs of the batch in its order. `expectation`: what a
    complete law may leave.
    """
    rows = zip(fit.residual, np.asarray(batch.weight), strict=True)
    residuals = [row[weight > 0] / weight[weight > 0] for row, weight in rows]
    even = [1.0 / run.sizes(run.recorded) for run in runs]
    intervals = [sampling_interval(run.time, run.protocol, run.quantity) for run in runs]
    records = [run.recorded for run in runs]
    return lack_of_fit(residuals, records, expectation, None, even, intervals)


def modulus_shifts(
    model: AugmentedModel, theta: Float[np.ndarray, " p"], batch: Batch
) -> Float[np.ndarray, "k runs n"]:
    """Return the change of the weighted residuals with each independent error of the moduli.

    Of the solvent too, where the sweep has one. An error of each has unit variance. Empty where the
    moduli are exact.
    """
    declared = model.declared
    if declared.modulus_covariance is None:
        return np.zeros((0, *np.shape(batch.weight)))

    # the solvent has no row where the moduli alone were told by the sweep
    moves = _SHIFT * root_of(declared.modulus_covariance).T
    moves = np.pad(moves, [(0, 0), (0, len(model.moduli) - moves.shape[1])])
    return np.nan_to_num(model.linearise(theta, batch, moves=moves).jacobian) / _SHIFT


def _response(
    jacobian: Float[np.ndarray, "free runs n"], shifts: Float[np.ndarray, "k runs n"]
) -> Float[np.ndarray, "free k"]:
    """Return by how much fitted parameters come out wrong with each error of the moduli."""
    design = jacobian.reshape(len(jacobian), -1).T
    scale = np.linalg.norm(design, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    target = shifts.reshape(len(shifts), -1).T
    return np.linalg.lstsq(design / scale, target, rcond=None)[0] / scale[:, None]


def _covariance_and_noise(
    batch: Batch, residual: Float[np.ndarray, "runs n"], jacobian: Float[np.ndarray, "free runs n"]
) -> tuple[Float[np.ndarray, "free free"], NoiseModel]:
    """Return the covariance of fitted parameters, and the noise that it rests on."""
    design = jacobian.reshape(len(jacobian), -1).T
    # a run that was left out of the fit says nothing of the noise
    told = [(rows, size) for rows, size in zip(*_sequences_of(batch), strict=True) if len(rows)]
    sequences, sizes = zip(*told, strict=True)
    covariance, _, noise = least_squares_covariance(
        design, residual.ravel(), sequences, sizes=sizes
    )
    return covariance, noise


def _sequences_of(batch: Batch) -> tuple[list[np.ndarray], list[float]]:
    """Return the rows of each run in a flattened residual, and the size of noise alike in all.

    Every run has a weight of one in all, however many samples share it; so where records are
    equally noisy, residuals of a long run are the smaller ones.
    """
    seen = np.asarray(batch.weight) > 0
    rows = np.arange(seen.size).reshape(seen.shape)
    sequences = [row[kept] for row, kept in zip(rows, seen, strict=True)]
    return sequences, [1.0 / np.sqrt(max(len(own), 1)) for own in sequences]
