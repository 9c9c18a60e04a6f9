"""Ends of intervals of constants that the data tell badly, found along the valley of the misfit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from discover.inference.fit_uncertainty import uncertainty
from discover.inference.least_squares import Fit
from discover.inference.problem import FitProblem

Bounds = Mapping[int, tuple[float, float]]

_WIDE = 0.1
"""Half width over value from which on the misfit may be no parabola as far as the interval goes."""

_MOST_STEPS, _REFINED = 12, 5
"""How often a distance is doubled until the misfit is too large, and then about halved."""

_TOLERANCE = 1e-5
"""Of refits: at the end of an interval the misfit of a thousand samples is larger by 4e-3."""


@dataclass(frozen=True)
class Profile:
    """Intervals from walks along the valley, and where these led.

    Attributes
    ----------
    bounds
        95 % intervals by position.
    possible
        Constants met on the way that these data do not exclude, all others refitted.
    """

    bounds: dict[int, tuple[float, float]]
    possible: tuple[Float[np.ndarray, " p"], ...] = ()


class _Coordinates:
    """Logarithms of what is positive, other constants as they are."""

    def __init__(self, problem: FitProblem, theta: np.ndarray):
        self._low, self._high = problem.model.low, problem.model.high
        self._positive = (self._low >= 0.0) & (theta > self._low)

    def of(self, theta: np.ndarray) -> np.ndarray:
        """Return the coordinates of constants."""
        positive = self._positive & (theta > 0.0)
        return np.where(positive, np.log(np.where(positive, theta, 1.0)), theta)

    def theta(self, coordinates: np.ndarray) -> np.ndarray:
        """Return the constants at coordinates, inside their ranges."""
        with np.errstate(over="ignore"):
            back = np.where(self._positive, np.exp(coordinates), coordinates)
        return np.clip(back, self._low, self._high)

    def slope(self, theta: np.ndarray) -> np.ndarray:
        """Return the derivatives of the coordinates in the constants."""
        return np.where(self._positive, 1.0 / np.where(self._positive, theta, 1.0), 1.0)


class _End:
    """One end of one interval on its way out.

    Attributes
    ----------
    at
        Position of the constant.
    start
        Where the next refit begins, the constant at its trial.
    closed
        Whether the end is found.
    """

    def __init__(
        self,
        at: int,
        coordinates: _Coordinates,
        fit: Fit,
        along: np.ndarray,
        reached: float,
        last: float,
    ):
        self.at, self.closed = at, False
        self._coordinates = coordinates
        self._origin = coordinates.of(fit.theta)
        self._furthest = self._distance(fit.theta, last)
        self._trial = self._distance(fit.theta, reached)
        self._along = along
        self._inside: tuple[float, float, np.ndarray] = (0.0, 0.0, self._origin)
        self._outside: tuple[float, float] | None = None
        self._refined = 0

    def _distance(self, theta: np.ndarray, value: float) -> float:
        moved = theta.copy()
        moved[self.at] = value
        return float(self._coordinates.of(moved)[self.at] - self._origin[self.at])

    @property
    def start(self) -> np.ndarray:
        """The others as the valley goes on from where it was seen last."""
        distance, _, seen = self._inside
        guess = seen + (self._trial - distance) * self._along
        guess[self.at] = self._origin[self.at] + self._trial
        return self._coordinates.theta(guess)

    def tell(self, deviations: float, quantile: float, theta: np.ndarray) -> None:
        """Take what a refit at the trial says, and choose the next trial."""
        if deviations < quantile:
            here = self._coordinates.of(theta)
            before, _, seen = self._inside
            self._along = (here - seen) / (self._trial - before)
            self._inside = self._trial, deviations, here
            self.closed = self._trial == self._furthest
        else:
            self._outside = self._trial, deviations
            # one that is not possible where it was asked about first ends nearer than that
            self.closed = self._inside[0] == 0.0
        if self._outside is None:
            self._trial = min(2.0 * self._trial, self._furthest, key=abs)
        elif self._refined == _REFINED:
            self.closed = True
        else:
            self._refined += 1
            self._trial = self._between(quantile)

    def _between(self, quantile: float) -> float:
        """Return the distance at which a straight line meets the quantile."""
        assert self._outside is not None
        (near, less, _), (far, more) = self._inside, self._outside
        share = (quantile - less) / (more - less) if np.isfinite(more) else 0.0
        # a misfit that rises like a wall is no straight line
        return near + float(np.clip(share, 0.25, 0.75)) * (far - near)

    def end(self, quantile: float) -> float | None:
        """Return where the interval ends; None if not beyond where it was asked about first."""
        if self._inside[0] == 0.0:
            return None
        away = self._inside[0] if self._outside is None else self._between(quantile)
        moved = self._origin.copy()
        moved[self.at] += away
        return float(self._coordinates.theta(moved)[self.at])


def profiled(problem: FitProblem, fit: Fit, bounds: Bounds, positions: Sequence[int]) -> Profile:
    """Return 95 % intervals that reach as far as the misfit allows when all else is refitted.

    An interval from the curvature at the fit takes the misfit for a parabola. Where two constants
    are told by their product alone that fails: along a hyperbola either of them may be anything.
    So each end of a wide interval is tried with all others refitted, and where the misfit there is
    less than the parabola says, the end moves out until it is as large, or to the end of the range
    that is physical   [Venzon & Moolgavkar 1988, Appl. Statist. 37, 87]. The unit is the variance
    that the interval rests on, noise that is correlated included. No interval becomes narrower.

    Parameters
    ----------
    problem, fit
        What was fitted, and the fit.
    bounds
        95 % intervals from the curvature, by position.
    positions
        Of the constants that are asked about.
    """
    found, possible = dict(bounds), []
    if not fit.free or not fit.usable:
        return Profile(found)
    covariance, quantile = uncertainty(problem.batch, fit.residual, fit.jacobian)
    units = _units(problem, fit, covariance)
    least = _misfit(problem, fit)
    ends = _ends(problem, fit, bounds, positions, covariance)
    for _ in range(_MOST_STEPS + _REFINED):
        going = [end for end in ends if not end.closed]
        if not going:
            break
        free = [[p for p in fit.free if p != end.at] for end in going]
        fits = problem.fits([end.start for end in going], free, tolerance=_TOLERANCE)
        for end, one in zip(going, fits, strict=True):
            more = _misfit(problem, one) - least
            more = more / units[end.at] if np.isfinite(more) else np.inf
            deviations = float(np.sqrt(max(more, 0.0)))
            end.tell(deviations, quantile, one.theta)
            if deviations < quantile:
                possible.append(one.theta)
    for end in ends:
        reached = end.end(quantile)
        if reached is not None:
            low, high = found[end.at]
            found[end.at] = min(low, reached), max(high, reached)
    return Profile(found, tuple(possible))


def _misfit(problem: FitProblem, fit: Fit) -> float:
    known = problem.prior.rows(fit.theta, fit.free)[0]
    return fit.cost + float(known @ known)


def _units(
    problem: FitProblem, fit: Fit, covariance: Float[np.ndarray, "free free"]
) -> dict[int, float]:
    """Return by how much the misfit grows at one standard deviation, were it a parabola."""
    design = fit.jacobian.reshape(len(fit.jacobian), -1).T
    design = np.concatenate([design, problem.prior.rows(fit.theta, fit.free)[1]])
    units = {}
    for column, at in enumerate(fit.free):
        own, others = design[:, column], np.delete(design, column, axis=1)
        scale = np.linalg.norm(others, axis=0)
        scale = np.where(scale > 0.0, scale, 1.0)
        alone = own - others @ (np.linalg.lstsq(others / scale, own, rcond=None)[0] / scale)
        units[at] = max(float(alone @ alone * covariance[column, column]), np.finfo(float).tiny)
    return units


def _ends(
    problem: FitProblem,
    fit: Fit,
    bounds: Bounds,
    positions: Sequence[int],
    covariance: Float[np.ndarray, "free free"],
) -> list[_End]:
    """Return the ends of wide intervals that are inside the range."""
    model, ends = problem.model, []
    coordinates = _Coordinates(problem, fit.theta)
    slope = coordinates.slope(fit.theta)
    for at in set(positions) & set(fit.free) & bounds.keys():
        value, low, high = (float(of[at]) for of in (fit.theta, model.low, model.high))
        below, above = bounds[at]
        # modulus and relaxation time are fitted as logarithms of a factor
        size = 1.0 if at < 2 else abs(value)
        if not np.isfinite([below, above]).all() or above - below < 2.0 * _WIDE * size:
            continue
        column = covariance[:, fit.free.index(at)]
        along = np.zeros(len(fit.theta))
        free = list(fit.free)
        along[free] = column / column[free.index(at)] * slope[free] / slope[at]
        for reached, last in ((below, low), (above, high)):
            if (last - reached) * (last - value) > 0.0:
                ends.append(_End(at, coordinates, fit, along, reached, last))
    return ends
