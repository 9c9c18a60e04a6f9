"""Levenberg–Marquardt for many small problems that share one compiled model."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from discover.closed_loop.augmented_model import AugmentedModel
from discover.closed_loop.run_batch import RunBatch

_LARGEST_DAMPING = 1e7
_MISSED = 10.0


@dataclass(frozen=True)
class Prior:
    """What other data say of some parameters, as rows of the least-squares problem.

    Attributes
    ----------
    positions
        Of the parameters.
    mean
        Their values.
    weight
        Residual per unit of deviation, in the units of the weighted residuals.
    """

    positions: tuple[int, ...] = ()
    mean: tuple[float, ...] = ()
    weight: tuple[float, ...] = ()

    def rows(
        self, theta: np.ndarray, free: Sequence[int]
    ) -> tuple[Float[np.ndarray, " rows"], Float[np.ndarray, "rows free"]]:
        """Return residuals and their derivatives in the free parameters."""
        known = [i for i, position in enumerate(self.positions) if position in free]
        residual = np.array(
            [self.weight[i] * (theta[self.positions[i]] - self.mean[i]) for i in known]
        )
        design = np.zeros((len(known), len(free)))
        for row, i in enumerate(known):
            design[row, list(free).index(self.positions[i])] = self.weight[i]
        return residual, design


NO_PRIOR = Prior()


@dataclass
class Fit:
    """A fitted parameter vector.

    Attributes
    ----------
    theta
        All parameters.
    free
        Positions of the fitted ones.
    residual
        Weighted residuals, shape (runs, n).
    jacobian
        Their derivatives with respect to the fitted parameters, shape (free, runs, n).
    """

    theta: Float[np.ndarray, " p"]
    free: tuple[int, ...]
    residual: Float[np.ndarray, "runs n"]
    jacobian: Float[np.ndarray, "free runs n"]

    @property
    def cost(self) -> float:
        """Sum over runs of the squared relative errors."""
        return float(np.sum(self.residual**2))

    @property
    def run_errors(self) -> Float[np.ndarray, " runs"]:
        """Root-mean-square error over root-mean-square stress of each run."""
        return np.sqrt(np.sum(self.residual**2, axis=1))

    @property
    def usable(self) -> bool:
        """Whether residuals and derivatives are all finite."""
        return bool(np.all(np.isfinite(self.residual)) and np.all(np.isfinite(self.jacobian)))


def fit_batch(
    model: AugmentedModel,
    batch: RunBatch,
    starts: Sequence[np.ndarray],
    free: Sequence[Sequence[int]],
    max_steps: int = 25,
    tolerance: float = 1e-4,
    prior: Prior = NO_PRIOR,
) -> list[Fit]:
    """Minimise the squared residuals from several starts, each in its own free parameters.

    All problems advance together, so that each step is a few calls of one compiled function.
    Derivatives are differences: a residual costs so little beside a compilation of its derivative
    that this is several times faster here. A trial that cannot be integrated has no finite
    residual and is a rejected step. Parameters stay in their admissible range by projection
    [Marquardt 1963, J. SIAM 11, 431].

    Parameters
    ----------
    model, batch
        What is fitted, to what.
    starts, free
        A parameter vector and the positions of its free parameters, for each problem.
    max_steps
        Largest number of steps.
    tolerance
        A problem is finished when a step lowers its cost by less than this fraction.
    prior
        What is known of some parameters; it counts where they are free.
    """
    theta = np.array(starts, dtype=float)
    count = len(theta)
    residual = model.residuals(theta, batch)

    def priced(costs, vectors, problems):
        known = [
            np.sum(prior.rows(v, free[i])[0] ** 2) for v, i in zip(vectors, problems, strict=True)
        ]
        return costs + np.array(known)

    cost = priced(_costs(residual), theta, range(count))
    damping = np.full(count, 1e-2)
    done = ~np.isfinite(cost) | np.array([len(positions) == 0 for positions in free])
    jacobian: list[np.ndarray | None] = [None] * count
    for _ in range(max_steps):
        if done.all():
            break
        stale = [int(i) for i in np.flatnonzero(~done) if jacobian[i] is None]
        fresh = jacobians(model, batch, theta[stale], residual[stale], [free[i] for i in stale])
        for i, value in zip(stale, fresh, strict=True):
            jacobian[i] = value
        going = [int(i) for i in np.flatnonzero(~done)]
        trial = theta[going].copy()
        for row, i in enumerate(going):
            at = list(free[i])
            known = prior.rows(theta[i], free[i])
            moved = theta[i, at] + _step(jacobian[i], residual[i], damping[i], known)
            trial[row, at] = np.clip(moved, model.low[at], model.high[at])
        trial_residual = model.residuals(trial, batch)
        trial_cost = priced(_costs(trial_residual), trial, going)
        for row, i in enumerate(going):
            if trial_cost[row] < cost[i]:
                done[i] = 1.0 - trial_cost[row] / cost[i] < tolerance
                theta[i], residual[i], cost[i] = trial[row], trial_residual[row], trial_cost[row]
                damping[i] = max(damping[i] / 5.0, 1e-10)
                jacobian[i] = None
            else:
                damping[i] *= 5.0
                done[i] = damping[i] > _LARGEST_DAMPING
    final = jacobians(model, batch, theta, residual, free)
    return [Fit(theta[i], tuple(free[i]), residual[i], final[i]) for i in range(count)]


def jacobians(model, batch, thetas, residuals, free) -> list[np.ndarray]:
    """Return derivatives of the residuals in the free parameters, (free, runs, n) each."""
    trials, widths = [], []
    for theta, positions in zip(thetas, free, strict=True):
        for position in positions:
            width = 1e-5 * max(abs(theta[position]), model.first_trial[position])
            # away from an upper bound
            width = -width if theta[position] + width > model.high[position] else width
            moved = theta.copy()
            moved[position] += width
            trials.append(moved)
            widths.append(width)
    if not trials:
        return [np.zeros((0, *residuals.shape[1:])) for _ in thetas]
    moved_residuals = model.residuals(trials, batch)
    out, row = [], 0
    for base, positions in zip(residuals, free, strict=True):
        n = len(positions)
        difference = moved_residuals[row : row + n] - base
        out.append(difference / np.asarray(widths[row : row + n])[:, None, None])
        row += n
    return out


def _costs(residual):
    with np.errstate(over="ignore", invalid="ignore"):
        cost = np.sum(residual**2, axis=(1, 2))
    return np.where(np.isfinite(cost), cost, np.inf)


def _step(jacobian, residual, damping, known=None):
    if len(jacobian) == 0:
        return np.zeros(0)
    design = jacobian.reshape(len(jacobian), -1).T
    if not np.all(np.isfinite(design)):
        return np.zeros(len(jacobian))
    residual = residual.ravel()
    if known is not None and len(known[0]):
        residual = np.concatenate([residual, known[0]])
        design = np.concatenate([design, known[1]])
    scale = np.linalg.norm(design, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    scaled = design / scale
    padded = np.concatenate([scaled, np.sqrt(damping) * np.eye(len(jacobian))])
    target = np.concatenate([-residual, np.zeros(len(jacobian))])
    return np.linalg.lstsq(padded, target, rcond=None)[0] / scale


def leave_one_run_out(
    model: AugmentedModel, batch: RunBatch, fit: Fit, prior: Prior = NO_PRIOR
) -> Float[np.ndarray, " runs"]:
    """Return the relative error of each run when it is left out of the fit.

    The fit without a run is one Gauss–Newton step from the fit with it, and the run is then
    predicted with the whole nonlinear model. A run whose prediction fails counts as missed by far.

    Parameters
    ----------
    model, batch, fit
        The fit to all runs.
    """
    n_runs = len(fit.residual)
    trials = []
    for left_out in range(n_runs):
        others = np.arange(n_runs) != left_out
        theta, at = fit.theta.copy(), list(fit.free)
        step = _step(fit.jacobian[:, others], fit.residual[others], 1e-8, prior.rows(theta, at))
        theta[at] = np.clip(theta[at] + step, model.low[at], model.high[at])
        trials.append(theta)
    errors = np.sqrt(np.sum(model.residuals(trials, batch) ** 2, axis=2))
    own = errors[np.arange(n_runs), np.arange(n_runs)]
    return np.where(np.isfinite(own), np.minimum(own, _MISSED), _MISSED)
