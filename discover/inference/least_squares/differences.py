"""Levenberg–Marquardt for many small problems that share one compiled model."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from jaxtyping import Float
from scipy.optimize import lsq_linear

from discover.forward import AugmentedModel, Batch, Linearised, Point, linearised

_LARGEST_DAMPING, _LEAST_DAMPING = 1e7, 1e-8
_FREE = 1.0
"""Damping, relative to the curvature, below which a step is the problem's own."""

_GROWTH = 5.0  # of the damping where a step is rejected, twice that at the next and so on

_FORETOLD = 0.25
"""Of the gain that derivatives predict, below which they are taken anew."""


@dataclass
class Fit:
    """A fitted parameter vector.

    Attributes
    ----------
    free
        Positions of the fitted ones.
    residual
        Weighted residuals, shape (runs, n).
    derivatives
        Those of the residuals, as `jacobian` returns them, or what computes them.
    """

    theta: Float[np.ndarray, " p"]
    free: tuple[int, ...]
    residual: Float[np.ndarray, "runs n"]
    derivatives: Float[np.ndarray, "free runs n"] | Callable[[], Float[np.ndarray, "free runs n"]]

    @cached_property
    def jacobian(self) -> Float[np.ndarray, "free runs n"]:
        """Derivatives of the residuals in the fitted parameters, computed when first asked for.

        Of rival fits most are never asked.
        """
        return self.derivatives() if callable(self.derivatives) else self.derivatives

    @property
    def cost(self) -> float:
        """Sum over runs of the squared relative errors."""
        with np.errstate(over="ignore", invalid="ignore"):  # of what diverged
            return float(np.sum(self.residual**2))

    @property
    def run_errors(self) -> Float[np.ndarray, " runs"]:
        """Root-mean-square error over root-mean-square stress of each run."""
        return np.sqrt(np.sum(self.residual**2, axis=1))

    @property
    def usable(self) -> bool:
        """Whether residuals and derivatives are all finite."""
        return bool(np.all(np.isfinite(self.residual)) and np.all(np.isfinite(self.jacobian)))


def best_of(fits: Iterable[Fit]) -> Fit | None:
    """Return the usable fit of the least cost; None where none is usable."""
    by_cost = sorted(fits, key=lambda fit: fit.cost if np.isfinite(fit.cost) else np.inf)
    return next((fit for fit in by_cost if fit.usable), None)


def fit_batch(
    model: AugmentedModel,
    batch: Batch,
    starts: Sequence[np.ndarray],
    free: Sequence[Sequence[int]],
    max_steps: int = 200,
    tolerance: float = 1e-4,
) -> list[Fit]:
    """Minimise the squared residuals from several starts, each in its own free parameters.

    All problems advance together, in one call for each step of all of them. Derivatives are
    differences: a residual costs so little beside a compilation of its derivative that this is
    several times faster here. As many vectors stand side by side in a call, what is left of them is
    filled with those by which the steps that are tried are differentiated. (Filled with other
    dampings of these steps, a fit ends in other minima, and no sooner.) Where there is no room, a
    step taken corrects derivatives as far as it tells about them   [Broyden 1965, Math. Comput. 19,
    577], and they are taken anew when a step so found is rejected, gains far less than they
    foretold, or is so short that the problem would count as finished. Damping falls as far as what
    was foretold is gained, and rises ever faster while it is not [Madsen, Nielsen & Tingleff 2004,
    Methods for Non-Linear Least Squares Problems, section 3.2]. A trial that cannot be integrated
    has no finite residual and is a rejected step. A step is the best that the admissible range of
    the parameters holds, so the others go on where one is at its bound [Kanzow, Yamashita &
    Fukushima 2004, J. Comput. Appl. Math. 172, 375].

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
    """
    given = [
        (np.array(start, dtype=float), list(at)) for start, at in zip(starts, free, strict=True)
    ]
    begun = linearised(model, [Point(theta, at) for theta, at in given], batch)
    descents = [
        _Descent(model, at, theta, found.residual, found.jacobian)
        for (theta, at), found in zip(given, begun, strict=True)
    ]
    lanes = model.vectors_at_once(batch)
    for _ in range(max_steps):
        going = [one for one in descents if not one.done]
        if not going:
            break
        asked = _asked(going, lanes)
        for one, point, found in zip(going, asked, linearised(model, asked, batch), strict=True):
            one.take(point, found, tolerance)
    return [one.ended(batch) for one in descents]


def _asked(going: Sequence["_Descent"], lanes: int) -> list[Point]:
    """Return what each problem asks about next, as many vectors as stand side by side."""
    asked = [one.next_point() for one in going]
    room = -sum(point.size for point in asked) % lanes
    for i in sorted(range(len(going)), key=lambda i: len(going[i].free)):
        free = going[i].free
        if not asked[i].positions and len(free) <= room:
            asked[i] = asked[i]._replace(positions=free)
            room -= len(free)
    return asked


@dataclass
class _Descent:
    """One problem on its way to its minimum.

    Attributes
    ----------
    model, free
        Whose residuals they are, and which parameters are fitted.
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
    free: list[int]
    theta: np.ndarray
    residual: np.ndarray
    derivatives: np.ndarray | None
    fresh: bool = True
    damping: float = 1e-2
    growth: float = _GROWTH
    done: bool = field(init=False)
    cost: float = field(init=False)

    def __post_init__(self):
        self.cost = _cost(self.residual)
        self.done = not np.isfinite(self.cost) or not self.free

    def ended(self, batch: Batch) -> Fit:
        """Return the fit, with derivatives where it has ended."""
        at, free = self.theta, tuple(self.free)
        if self.fresh and self.derivatives is not None:
            return Fit(at, free, self.residual, self.derivatives)
        point, model = Point(at, free, self.residual), self.model
        return Fit(at, free, self.residual, lambda: linearised(model, [point], batch)[0].jacobian)

    def next_point(self) -> Point:
        """Return the parameters after one more step, or where derivatives are to be taken."""
        if self.derivatives is None:
            return Point(self.theta, self.free, self.residual)
        at, derivatives = (self.theta, self.free, self.residual), self.derivatives
        theta = _stepped(self.model, *at, derivatives, self.damping)
        return Point(theta, limit=self.cost)

    def _foretold(self, step: np.ndarray) -> float:
        """Return by how much a step lowers the cost if derivatives stay what they are."""
        assert self.derivatives is not None  # the step was found with them
        change = np.tensordot(step, self.derivatives, axes=1)
        return -float(np.sum(change * (2.0 * self.residual + change)))

    def take(self, point: Point, found: Linearised, tolerance: float) -> None:
        """Take the step that was tried, or try a shorter one or other derivatives next time.

        Parameters
        ----------
        point, found
            What was asked about, and the answer.
        tolerance
            Share of the cost below which a step gains hardly anything.
        """
        if self.derivatives is None:
            self.derivatives, self.fresh = found.jacobian, True
            return
        theta, residual = point.theta, found.residual
        cost = _cost(residual)
        if not cost < self.cost:
            if self.fresh:
                self.damping, self.growth = self.damping * self.growth, 2.0 * self.growth
                self.done = self.damping > _LARGEST_DAMPING
            else:
                self.derivatives = None
            return
        gain = 1.0 - cost / self.cost
        short = gain < tolerance
        # a step that damping cut short gains little anywhere
        self.done = self.damping < _FREE and short and self.fresh
        step, change = theta[self.free] - self.theta[self.free], residual - self.residual
        # at most all of it: a model that predicts nothing says nothing
        share = min((self.cost - cost) / max(self._foretold(step), 1e-300), 1.0)
        less = max(1.0 / _GROWTH, 1.0 - (2.0 * share - 1.0) ** 3)
        self.damping, self.growth = max(self.damping * less, _LEAST_DAMPING), _GROWTH
        self.theta, self.residual, self.cost = theta, residual, cost
        if point.positions and np.all(np.isfinite(found.jacobian)):
            self.derivatives, self.fresh = found.jacobian, True
        else:
            anew = self.done or short or share < _FORETOLD
            self.derivatives = None if anew else _corrected(self.derivatives, step, change)
            self.fresh = False


def _cost(residual: Float[np.ndarray, "runs n"]) -> float:
    """Return the sum of squares; infinite for a trial that diverged."""
    with np.errstate(over="ignore", invalid="ignore"):
        cost = float(np.sum(residual**2))
    return cost if np.isfinite(cost) else np.inf


def _stepped(
    model: AugmentedModel,
    theta: Float[np.ndarray, " p"],
    free: Sequence[int],
    residual: Float[np.ndarray, "runs n"],
    jacobian: Float[np.ndarray, "free runs n"],
    damping: float,
) -> Float[np.ndarray, " p"]:
    """Return parameters after the best damped step that the ranges of what is free hold."""
    at, moved = list(free), theta.copy()
    design = jacobian.reshape(len(at), -1).T
    if not at or not np.all(np.isfinite(design)):
        return moved
    scale = np.linalg.norm(design, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    padded = np.concatenate([design / scale, np.sqrt(damping) * np.eye(len(at))])
    target = np.concatenate([-residual.ravel(), np.zeros(len(at))])
    step = np.linalg.lstsq(padded, target, rcond=None)[0]
    low, high = scale * (model.low[at] - theta[at]), scale * (model.high[at] - theta[at])
    if np.any((step < low) | (step > high)):
        high = np.maximum(high, np.nextafter(low, np.inf))  # a range may be one value
        step = lsq_linear(padded, target, (low, high), method="bvls").x
    moved[at] = np.clip(theta[at] + step / scale, model.low[at], model.high[at])
    return moved


def _corrected(jacobian, step, change):
    """Return derivatives that explain the change that a step made."""
    missed = change - np.tensordot(step, jacobian, axes=1)
    return jacobian + np.multiply.outer(step / (step @ step), missed)
