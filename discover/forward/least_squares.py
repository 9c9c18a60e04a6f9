"""Levenberg–Marquardt for many small problems that share one compiled model."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.stats import t as student

from discover.forward.augmented_model import AugmentedModel
from discover.forward.batches import Batch
from discover.forward.modulus_errors import response
from discover.statistics import NoiseModel, least_squares_covariance

_LARGEST_DAMPING, _LEAST_DAMPING = 1e7, 1e-8
_FAR_BEHIND, _HARDLY = 2.0, 0.05
_FREE = 1.0
"""Damping, relative to the curvature, below which a step is the problem's own."""

_GROWTH = 5.0  # of the damping where a step is rejected, twice that at the next and so on

_FORETOLD = 0.25
"""Of the gain that derivatives foretell, below which they are taken anew."""


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
    batch: Batch,
    starts: Sequence[np.ndarray],
    free: Sequence[Sequence[int]],
    max_steps: int = 200,
    tolerance: float = 1e-4,
    prior: Prior = NO_PRIOR,
    rivals: bool = False,
) -> list[Fit]:
    """Minimise the squared residuals from several starts, each in its own free parameters.

    All problems advance together, so that each step is a few calls of one compiled function.
    Derivatives are differences: a residual costs so little beside a compilation of its derivative
    that this is several times faster here. A step taken corrects them as far as it tells about
    them   [Broyden 1965, Math. Comput. 19, 577], and they are taken anew when a step so found is
    rejected, gains far less than they foretold, or is so short that the problem would count as
    finished: a step then costs one residual instead of one for each parameter. Damping falls as far
    as what was foretold is gained, and rises ever faster while it is not   [Madsen, Nielsen &
    Tingleff 2004, Methods for Non-Linear Least Squares Problems, section 3.2]. A trial that cannot
    be integrated has no finite residual and is a rejected step. Parameters stay in their admissible
    range by projection   [Marquardt 1963, J. SIAM 11, 431].

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
    rivals
        Whether only the best problems matter: one that is far behind and hardly gains any more is
        left where it is.
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
    damping, growth = np.full(count, 1e-2), np.full(count, _GROWTH)
    done = ~np.isfinite(cost) | np.array([len(positions) == 0 for positions in free])
    jacobian: list[np.ndarray | None] = [None] * count
    fresh = np.zeros(count, dtype=bool)
    for _ in range(max_steps):
        if done.all():
            break
        stale = [int(i) for i in np.flatnonzero(~done) if jacobian[i] is None]
        taken = jacobians(model, batch, theta[stale], residual[stale], [free[i] for i in stale])
        for i, value in zip(stale, taken, strict=True):
            jacobian[i], fresh[i] = value, True
        going = [int(i) for i in np.flatnonzero(~done)]
        trial, foretold = theta[going].copy(), np.zeros(len(going))
        for row, i in enumerate(going):
            at = list(free[i])
            known = prior.rows(theta[i], free[i])
            moved = theta[i, at] + gauss_newton_step(jacobian[i], residual[i], damping[i], known)
            trial[row, at] = np.clip(moved, model.low[at], model.high[at])
            foretold[row] = _foretold(jacobian[i], residual[i], trial[row, at] - theta[i, at])
        trial_residual = model.residuals(trial, batch, cost[going])
        trial_cost = priced(_costs(trial_residual), trial, going)
        for row, i in enumerate(going):
            if trial_cost[row] < cost[i]:
                gain = 1.0 - trial_cost[row] / cost[i]
                short = gain < tolerance
                # at most all of it: a model that foretells nothing says nothing
                share = min((cost[i] - trial_cost[row]) / max(foretold[row], 1e-300), 1.0)
                behind = rivals and cost[i] > _FAR_BEHIND * np.min(cost) and gain < _HARDLY
                # a step that damping cut short gains little anywhere
                done[i] = damping[i] < _FREE and ((short and fresh[i]) or behind)
                step = trial[row, list(free[i])] - theta[i, list(free[i])]
                change = trial_residual[row] - residual[i]
                theta[i], residual[i], cost[i] = trial[row], trial_residual[row], trial_cost[row]
                less = max(1.0 / _GROWTH, 1.0 - (2.0 * share - 1.0) ** 3)
                damping[i], growth[i] = max(damping[i] * less, _LEAST_DAMPING), _GROWTH
                if not done[i]:
                    anew = short or share < _FORETOLD
                    jacobian[i] = None if anew else _corrected(jacobian[i], step, change)
                    fresh[i] = False
            elif fresh[i]:
                damping[i], growth[i] = damping[i] * growth[i], 2.0 * growth[i]
                done[i] = damping[i] > _LARGEST_DAMPING
            else:
                jacobian[i] = None
    # those of the last step, unless that was not the last
    missing = [i for i in range(count) if not fresh[i]]
    taken = jacobians(model, batch, theta[missing], residual[missing], [free[i] for i in missing])
    for i, value in zip(missing, taken, strict=True):
        jacobian[i] = value
    return [
        Fit(theta[i], tuple(free[i]), residual[i], derivatives)
        for i, derivatives in enumerate(jacobian)
        if derivatives is not None
    ]


def jacobians(model, batch, thetas, residuals, free) -> list[np.ndarray]:
    """Return derivatives of the residuals in the free parameters, (free, runs, n) each."""
    trials, widths = [], []
    for theta, positions in zip(thetas, free, strict=True):
        for position, width in zip(positions, widths_of(model, theta, positions), strict=True):
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
        with np.errstate(invalid="ignore", over="ignore"):  # a trial that ran away
            difference = moved_residuals[row : row + n] - base
        out.append(difference / np.asarray(widths[row : row + n])[:, None, None])
        row += n
    return out


def widths_of(
    model: AugmentedModel, theta: Float[np.ndarray, " p"], positions: Sequence[int]
) -> Float[np.ndarray, " positions"]:
    """Return by how much parameters are moved for a derivative, away from an upper bound."""
    at = list(positions)
    width = 1e-5 * np.maximum(np.abs(theta[at]), model.first_trial[at])
    return np.where(theta[at] + width > model.high[at], -width, width)


def _corrected(jacobian, step, change):
    """Return derivatives that explain the change that a step made."""
    missed = change - np.tensordot(step, jacobian, axes=1)
    return jacobian + np.multiply.outer(step / (step @ step), missed)


def _foretold(jacobian, residual, step) -> float:
    """Return by how much a step lowers the cost if derivatives stay what they are."""
    if not len(step):
        return 0.0
    change = np.tensordot(step, jacobian, axes=1)
    return float(-np.sum(change * (2.0 * residual + change)))


def _costs(residual):
    with np.errstate(over="ignore", invalid="ignore"):
        cost = np.sum(residual**2, axis=(1, 2))
    return np.where(np.isfinite(cost), cost, np.inf)


def gauss_newton_step(jacobian, residual, damping, known=None):
    """Return the damped step of the free parameters, with rows of what is known of them."""
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


def intervals(
    model: AugmentedModel,
    batch: Batch,
    fit: Fit,
    shifts: Float[np.ndarray, "k runs n"] | None = None,
) -> dict[int, tuple[float, float]]:
    """Return the 95 % interval of each fitted parameter, by position.

    From the curvature at the fit and the noise that its residual shows; see
    `discover.statistics.least_squares_covariance`.

    Parameters
    ----------
    model, batch, fit
        The model, the fitted runs and the fit.
    shifts
        What errors of the moduli change (`modulus_shifts`); None takes the moduli for exact.
    """
    if not fit.free:
        return {}
    covariance, quantile = uncertainty(batch, fit.residual, fit.jacobian)
    if shifts is not None and len(shifts):
        off = response(fit.jacobian, shifts)
        covariance = covariance + off @ off.T
    half = quantile * np.sqrt(np.clip(np.diag(covariance), 0.0, None))
    bounds = {}
    for position, h in zip(fit.free, half, strict=True):
        value, low, high = fit.theta[position], model.low[position], model.high[position]
        # a time must be positive, and what may be as short as that may be nothing
        floor = 0.0 if 0.0 < low < 1e-6 * value else low
        bounds[position] = (
            float(floor if value - h < low else value - h),
            float(min(value + h, high)),
        )
    return bounds


def uncertainty(
    batch: Batch, residual: Float[np.ndarray, "runs n"], jacobian: Float[np.ndarray, "free runs n"]
) -> tuple[Float[np.ndarray, "free free"], float]:
    """Return the covariance of fitted parameters, and how many deviations hold 95 %."""
    covariance, noise = covariance_and_noise(batch, residual, jacobian)
    independent = max(noise.effective_samples - len(jacobian), 1.0)
    return covariance, float(student.ppf(0.975, independent))


def covariance_and_noise(
    batch: Batch, residual: Float[np.ndarray, "runs n"], jacobian: Float[np.ndarray, "free runs n"]
) -> tuple[Float[np.ndarray, "free free"], NoiseModel]:
    """Return the covariance of fitted parameters, and the noise that it rests on."""
    design = jacobian.reshape(len(jacobian), -1).T
    # a run that was left out of the fit says nothing of the noise
    told = [(rows, size) for rows, size in zip(*sequences_of(batch), strict=True) if len(rows)]
    sequences, sizes = zip(*told, strict=True)
    covariance, _, noise = least_squares_covariance(
        design, residual.ravel(), sequences, sizes=sizes
    )
    return covariance, noise


def sequences_of(batch: Batch) -> tuple[list[np.ndarray], list[float]]:
    """Return the rows of each run in a flattened residual, and the size of noise alike in all.

    Every run has a weight of one in all, however many samples share it; so where records are
    equally noisy, residuals of a long run are the smaller ones.
    """
    seen = np.asarray(batch.weight) > 0
    rows = np.arange(seen.size).reshape(seen.shape)
    sequences = [row[kept] for row, kept in zip(rows, seen, strict=True)]
    return sequences, [1.0 / np.sqrt(max(len(own), 1)) for own in sequences]
