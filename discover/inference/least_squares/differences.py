"""Levenberg–Marquardt for many small problems that share one compiled model."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from discover.forward import AugmentedModel, Batch
from discover.inference.least_squares.fit import NO_PRIOR, Fit, Prior
from discover.inference.least_squares.steps import stepped

_LARGEST_DAMPING, _LEAST_DAMPING = 1e7, 1e-8
_FAR_BEHIND, _HARDLY = 2.0, 0.05
_FREE = 1.0
"""Damping, relative to the curvature, below which a step is the problem's own."""

_GROWTH = 5.0  # of the damping where a step is rejected, twice that at the next and so on

_FORETOLD = 0.25
"""Of the gain that derivatives foretell, below which they are taken anew."""


def fit_batch(
    model: AugmentedModel,
    batch: Batch,
    starts: Sequence[np.ndarray],
    free: Sequence[Sequence[int]],
    max_steps: int = 200,
    tolerance: float = 1e-4,
    prior: Prior = NO_PRIOR,
    rivals: bool = False,
    known: float = np.inf,
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
    be integrated has no finite residual and is a rejected step. A step is the best that the
    admissible range of the parameters holds, so the others go on where one is at its bound
    [Kanzow, Yamashita & Fukushima 2004, J. Comput. Appl. Math. 172, 375].

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
    known
        Cost of the best fit that the problems compete with beside one another.
    """
    thetas = np.array(starts, dtype=float)
    residuals = model.residuals(thetas, batch)
    descents = [
        _Descent(model, prior, list(positions), theta, residual)
        for theta, positions, residual in zip(thetas, free, residuals, strict=True)
    ]
    for _ in range(max_steps):
        going = [one for one in descents if not one.done]
        if not going:
            break
        _differentiate([one for one in going if one.derivatives is None], batch)
        trials = np.array([one.trial() for one in going])
        tried = model.residuals(trials, batch, np.array([one.cost for one in going]))
        for one, trial, residual in zip(going, trials, tried, strict=True):
            best = min(known, *(other.cost for other in descents)) if rivals else np.inf
            one.judge(trial, residual, tolerance, best)
    return [one.ended(batch) for one in descents]


@dataclass
class _Descent:
    """One problem on its way to its minimum.

    Attributes
    ----------
    model, prior, free
        Whose residuals they are, what is known of the parameters, and which are fitted.
    theta, residual
        Where it is.
    derivatives
        Of the residual in what is free; None where they are to be taken anew.
    fresh
        Whether they were taken here, and not corrected on the way.
    damping, growth
        Of a step, and by how much the former grows where one is rejected.
    done
        Whether it has ended.
    """

    model: AugmentedModel
    prior: Prior
    free: list[int]
    theta: np.ndarray
    residual: np.ndarray
    derivatives: np.ndarray | None = None
    fresh: bool = False
    damping: float = 1e-2
    growth: float = _GROWTH
    done: bool = field(init=False)
    cost: float = field(init=False)

    def __post_init__(self):
        self.cost = self._cost(self.theta, self.residual)
        self.done = not np.isfinite(self.cost) or not self.free

    def ended(self, batch: Batch) -> Fit:
        """Return the fit, with derivatives where it has ended."""
        at, free = self.theta, tuple(self.free)
        if self.fresh and self.derivatives is not None:
            return Fit(at, free, self.residual, self.derivatives)

        def anew() -> np.ndarray:
            return jacobians(self.model, batch, [at], self.residual[None], [free])[0]

        return Fit(at, free, self.residual, anew)

    def _cost(self, theta: np.ndarray, residual: np.ndarray) -> float:
        """Return the sum of squares, what is known of parameters included; else infinite."""
        with np.errstate(over="ignore", invalid="ignore"):  # a trial that ran away
            cost = np.sum(residual**2) + np.sum(self.prior.rows(theta, self.free)[0] ** 2)
        return float(cost) if np.isfinite(cost) else np.inf

    def trial(self) -> np.ndarray:
        """Return the parameters after one more step."""
        assert self.derivatives is not None  # they are taken before
        return stepped(
            self.model,
            self.theta,
            self.free,
            self.residual,
            self.derivatives,
            self.damping,
            self.prior,
        )

    def _foretold(self, step: np.ndarray) -> float:
        """Return by how much a step lowers the cost if derivatives stay what they are."""
        assert self.derivatives is not None  # the step was found with them
        known, design = self.prior.rows(self.theta, self.free)
        change, of_known = np.tensordot(step, self.derivatives, axes=1), design @ step
        gain = np.sum(change * (2.0 * self.residual + change))
        return -float(gain + np.sum(of_known * (2.0 * known + of_known)))

    def judge(self, theta: np.ndarray, residual: np.ndarray, tolerance: float, best: float):
        """Take the step to a trial, or try a shorter one or other derivatives the next time.

        Parameters
        ----------
        theta, residual
            Of the trial.
        tolerance
            Share of the cost below which a step gains hardly anything.
        best
            Least cost of all problems; infinite where being behind it is no reason to end.
        """
        cost = self._cost(theta, residual)
        if not cost < self.cost:
            if self.fresh:
                self.damping, self.growth = self.damping * self.growth, 2.0 * self.growth
                self.done = self.damping > _LARGEST_DAMPING
            else:
                self.derivatives = None
            return
        gain = 1.0 - cost / self.cost
        short = gain < tolerance
        behind = self.cost > _FAR_BEHIND * best and gain < _HARDLY
        # a step that damping cut short gains little anywhere
        self.done = self.damping < _FREE and ((short and self.fresh) or behind)
        step, change = theta[self.free] - self.theta[self.free], residual - self.residual
        # at most all of it: a model that foretells nothing says nothing
        share = min((self.cost - cost) / max(self._foretold(step), 1e-300), 1.0)
        less = max(1.0 / _GROWTH, 1.0 - (2.0 * share - 1.0) ** 3)
        self.damping, self.growth = max(self.damping * less, _LEAST_DAMPING), _GROWTH
        self.theta, self.residual, self.cost = theta, residual, cost
        if not self.done:
            anew = short or share < _FORETOLD
            self.derivatives = None if anew else _corrected(self.derivatives, step, change)
            self.fresh = False


def _differentiate(descents: Sequence[_Descent], batch: Batch):
    """Take derivatives anew, of all problems in one call."""
    if not descents:
        return
    theta, residual = ([getattr(d, name) for d in descents] for name in ("theta", "residual"))
    free = [one.free for one in descents]
    found = jacobians(descents[0].model, batch, theta, np.array(residual), free)
    for one, derivatives in zip(descents, found, strict=True):
        one.derivatives, one.fresh = derivatives, True


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
