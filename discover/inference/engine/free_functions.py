"""Free functions: curves of one variable beside a hypothesis, for what has no name.

What a hypothesis leaves may be one function in all runs: of the stress, as of a transducer that
bends, of the time or the shear rate, or a factor that depends on the strain. Such a function is a
hypothesis like any other: changes of slope at a few knots, each normal about zero with one width
[Wahba 1978, J. R. Stat. Soc. B 40, 364], fitted together with the constants of the law and weighed
by the same evidence.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.stats import chi2

from discover.dataset import Run
from discover.inference.engine.discrepancy import Discrepancy
from discover.inference.engine.fits import Fit, Fitter
from discover.inference.engine.posterior import Posterior
from discover.inference.engine.priors import Deviations
from discover.inference.engine.problem import TERM_ODDS
from discover.inference.engine.search import Search
from discover.linear_algebra_threads import in_one_thread

_LATE = (0.0, 0.15, 0.3, 0.45, 0.6, 0.7, 0.8, 0.9, 1.0)
_EARLY = (0.0, 0.02, 0.05, 0.1, 0.18, 0.3, 0.45, 0.65, 0.85)
"""Where the slope changes, over the largest value: what saturates does so at the end of a range,
what settles at its beginning."""

_KNOTS = len(_LATE)

_WIDTHS = (0.03, 0.1, 0.3, 1.0, 3.0)
"""Standard deviations of a change of slope, both axes over their size."""

_BASES = 12
"""Hypotheses of each size beside which a function is tried to first order."""

_LARGEST_BASE = 2
_REFITTED = 4
_TOLD = 15.0
"""Log odds against all that has a name and any other discrepancy, from which on a curve is shown.
On development seeds one that is there has 35 and more; one that stands for a law of no dictionary,
up to 10."""

_POSSIBLE = -7.0
"""Log odds from which on a curve is among what is possible, shown or not."""

_WORTH_IT = -20.0
"""Log odds in the fitted runs from which on a curve is weighed in all runs."""

_POINTS = 61
_TRIED = 60
_USUAL = 0.95
_RESOLVED = 0.05


@dataclass(frozen=True)
class Variable:
    """What a function depends on, and what it does to a record.

    Attributes
    ----------
    slot, name, unit
        Of the function, as the contract names it: ``recorded_stress``, ``rate``, ``drift`` or
        ``network``.
    values
        At each row; None for the stress, which is that of the fluid as predicted.
    largest
        In the fitted runs.
    is_factor
        Whether the stress is multiplied.
    """

    slot: str
    name: str
    unit: str
    values: Float[np.ndarray, " rows"] | None
    largest: float
    is_factor: bool = False

    @property
    def is_odd(self) -> bool:
        """Whether the function changes its sign with that of its variable."""
        return self.slot in ("recorded_stress", "rate")

    def basis(self, values: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n knots"]:
        """Return what one change of slope at each knot is at some values."""
        x = np.abs(values) / self.largest
        hinges = np.maximum(x[:, None] - np.array(_LATE if self.is_odd else _EARLY), 0.0)
        return hinges * np.sign(values)[:, None] if self.is_odd else hinges

    def columns(self, predicted: Float[np.ndarray, " rows"], size: Float[np.ndarray, " rows"]):
        """Return what one of each does to the records, in Pa."""
        along = predicted if self.values is None else self.values
        scale = predicted if self.is_factor else np.sqrt(np.mean(size**2))
        return self.basis(along) * np.broadcast_to(scale, predicted.shape)[:, None]


@dataclass(frozen=True)
class FreeFunction:
    """A function of one variable that explains what effects with a name leave.

    Attributes
    ----------
    variable
        What it depends on.
    beside
        Effects in the hypothesis with it.
    log_odds
        Against all that has a name, and any discrepancy of another kind, by the fitted runs.
    log_odds_in_all
        The same by all runs, as explanations are weighed.
    grid, value, low95, high95
        The curve with its 95 % band, shape (n,), in Pa or as a relative change.
    nearest
        A closed form that is it within its uncertainty; None if none of those tried is.
    """

    variable: Variable
    beside: tuple[str, ...]
    log_odds: float
    log_odds_in_all: float
    grid: Float[np.ndarray, " n"]
    value: Float[np.ndarray, " n"]
    low95: Float[np.ndarray, " n"]
    high95: Float[np.ndarray, " n"]
    nearest: str | None

    @property
    def is_shown(self) -> bool:
        """Whether it stands out so far that the runs have a curve of this shape."""
        return self.log_odds > _TOLD

    @property
    def weight(self) -> float:
        """Log odds by which it counts: held-out runs may show it, and need not have it too."""
        return max(self.log_odds, self.log_odds_in_all)


class WithFunction(Fitter):
    """Fits of hypotheses with a function of one variable beside them.

    Parameters
    ----------
    fitter
        What fits them without.
    variable, width
        Of the function: what it depends on, and how much its slope changes at a knot.
    """

    def __init__(self, fitter: Fitter, variable: Variable, width: float):
        self.__dict__.update(vars(fitter))
        self.variable, self.width = variable, width
        first = fitter.linear_count
        self.deviations = [*fitter.deviations, (slice(first, first + _KNOTS), Deviations(width))]

    def linear_columns(
        self,
        predicted: Float[np.ndarray, " rows"],
        shifts: Float[np.ndarray, "rows k"] | None = None,
    ) -> Float[np.ndarray, "rows q"]:
        """Return what one of each does to the records, in Pa; the function last."""
        own = self.variable.columns(predicted, self.rows.size)
        return np.column_stack([super().linear_columns(predicted, shifts), own])

    def records(
        self,
        fit: Fit,
        predicted: Float[np.ndarray, "trials rows"],
        linear: Float[np.ndarray, "trials q"],
    ) -> Float[np.ndarray, "trials rows"]:
        """Return the records of trials of a fit; the function last."""
        own = [
            self.variable.columns(one, self.rows.size) @ values[-_KNOTS:]
            for one, values in zip(predicted, linear, strict=True)
        ]
        return super().records(fit, predicted, linear) + own

    def gain(self, fit: Fit) -> Float[np.ndarray, " rows"]:
        """Return by how much a record changes with the stress of the fluid."""
        gain, own, step = super().gain(fit), fit.linear[-_KNOTS:], 1e-6
        if self.variable.values is None or self.variable.is_factor:
            moved = self.variable.columns(fit.predicted * (1.0 + step), self.rows.size)
            change = (moved - self.variable.columns(fit.predicted, self.rows.size)) @ own
            gain = gain + change / np.where(fit.predicted == 0.0, np.inf, step * fit.predicted)
        return gain


@in_one_thread
def free_functions(posterior: Posterior) -> list[FreeFunction]:
    """Return the functions that are possible beside all other explanations, the likeliest first.

    They are tried beside hypotheses of few effects: a larger one may have taken up what they are.
    """
    search = posterior.search
    left, fits = posterior.left, list(search.found.values())
    if left is None:
        return []
    usable = [f for f in fits if f.covariance is not None and not f.at_an_end]
    usable.sort(key=lambda fit: -fit.log_likelihood)
    sizes = range(_LARGEST_BASE + 1)
    bases = [f for size in sizes for f in [f for f in usable if len(f.names) == size][:_BASES]]
    whole, _, discrepancies = posterior.memory["whole"]
    other, in_all = _likeliest(search, [left]), _likeliest(whole, discrepancies)
    prior, found = posterior.problem.log_odds_of(TERM_ODDS), []
    everywhere = {one.slot: one for one in _variables(whole.fitter)}
    for variable in _variables(search.fitter):
        fitted = [
            (fit.log_evidence + posterior.problem.log_prior(fit.names) + prior, fitter, fit)
            for fitter, starts in _starts(search.fitter, bases, variable)
            for fit in fitter.fit(starts)
        ]
        if not fitted:
            continue
        rank, fitter, fit = max(fitted, key=lambda one: one[0])
        if rank - other < _WORTH_IT:
            continue
        odds = -np.inf  # where runs held out have no such variable
        if variable.slot in everywhere:
            again = WithFunction(whole.fitter, everywhere[variable.slot], fitter.width)
            (refit,) = again.fit([again.start(fit.names, fit.theta)])
            odds = refit.log_evidence - fit.log_evidence + rank - in_all
        if max(rank - other, odds) > _POSSIBLE:
            found.append(_described(fitter, fit, float(rank - other), float(odds)))
    return sorted(found, key=lambda one: -one.log_odds)


def _likeliest(search: Search, discrepancies: Sequence[Discrepancy]) -> float:
    """Return the largest log of evidence times prior, with a discrepancy or without."""
    beside = [search.rank(one.fit) + one.log_factor for one in discrepancies]
    return max(*beside, *(search.rank(fit) for fit in search.alive()[:1]))


def _variables(fitter: Fitter) -> Iterator[Variable]:
    rows, runs = fitter.rows, fitter.rows.runs
    if any(run.protocol.control != "rate" or run.flow != "shear" for run in runs):
        return

    def of(slot: str, name: str, unit: str, values, is_factor: bool = False) -> Variable:
        return Variable(slot, name, unit, values, float(np.max(np.abs(values))), is_factor)

    largest = float(np.max(np.abs(rows.recorded)))
    yield Variable("recorded_stress", "stress", "Pa", None, largest)
    rates, times, strains = (
        np.concatenate([one(run) for run in runs])
        for one in (lambda r: np.asarray(r.rate), lambda r: np.asarray(r.time), _strain)
    )
    if len(np.unique(np.abs(rates))) > _KNOTS:
        yield of("rate", "shear rate", "1/s", rates)
    yield of("drift", "time", "s", times)
    yield of("network", "strain", "", strains, True)


def _strain(run: Run) -> Float[np.ndarray, " n"]:
    """Return the strain at each sample, from rest."""
    time, rate = np.asarray(run.time), np.asarray(run.rate)
    steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(time)
    return rate[0] * time[0] + np.concatenate([[0.0], np.cumsum(steps)])


def _starts(
    fitter: Fitter, bases: Sequence[Fit], variable: Variable
) -> list[tuple[WithFunction, list[Fit]]]:
    """Return the most promising hypotheses with a function, scored to first order, by its width."""
    scored = []
    for width in _WIDTHS:
        own = WithFunction(fitter, variable, width)
        for fit in bases:
            assert fit.jacobian is not None
            assert fit.covariance is not None
            columns = np.column_stack(
                [fit.jacobian, variable.columns(fit.predicted, fitter.rows.size)]
            )
            record, k = fitter.record(fit), _KNOTS
            both = np.column_stack([columns, fitter.rows.recorded - record])
            white = fitter.noise.whitened(both, record, fit.noise)
            curvature = white[:, :-1].T @ white[:, :-1]
            curvature[:-k, :-k] = np.linalg.inv(fit.covariance)
            at = np.arange(len(curvature) - k, len(curvature))
            curvature[at, at] += 1.0 / width**2
            slope = white[:, :-1].T @ white[:, -1]
            slope[:-k] = 0.0  # at the maximum of the posterior without the function
            step = np.linalg.solve(curvature, slope)
            left = fitter.rows.recorded - record - columns @ step
            value, _ = fitter.noise.log_likelihood(left, record + columns @ step)
            inner = np.linalg.inv(np.linalg.inv(curvature)[-k:, -k:].T)
            value -= 0.5 * np.linalg.slogdet(inner * width**2)[1]
            value += fitter.problem.log_prior(fit.names) - 0.5 * float(
                np.sum((step[-k:] / width) ** 2)
            )
            linear = np.append(fit.linear, step[-k:])
            scored.append((value, width, own, own.start(fit.names, fit.theta, linear)))
    scored.sort(key=lambda one: -one[0])
    chosen: dict[float, tuple[WithFunction, list[Fit]]] = {}
    for _, width, own, start in scored[: 2 * _REFITTED]:
        chosen.setdefault(width, (own, []))[1].append(start)
    return list(chosen.values())


def _described(fitter: WithFunction, fit: Fit, odds: float, odds_in_all: float) -> FreeFunction:
    """Return a function that was fitted, with its band and its closed form."""
    assert fit.covariance is not None
    variable, k = fitter.variable, _KNOTS
    along = fit.predicted if variable.values is None else variable.values
    low = 0.0 if variable.is_odd else float(np.min(np.abs(along)))
    grid = np.linspace(low, float(np.max(np.abs(along))), _POINTS)
    size = 1.0 if variable.is_factor else float(np.sqrt(np.mean(fitter.rows.size**2)))
    basis = size * variable.basis(grid)
    value, spread = basis @ fit.linear[-k:], basis @ np.linalg.cholesky(fit.covariance[-k:, -k:])
    half = 1.96 * np.sqrt(np.sum(spread**2, axis=1))
    nearest = _nearest(variable, fit, grid, size)
    return FreeFunction(
        variable, fit.names, odds, odds_in_all, grid, value, value - half, value + half, nearest
    )  # fmt: skip


def _forms(slot: str, x: Float[np.ndarray, " n"], inner: float) -> dict[str, np.ndarray]:
    """Return closed forms of a slot, x and their inner constant over the largest value."""
    if slot == "recorded_stress":
        return {"clipped": np.maximum(x - inner, 0.0), "cubic": x**3}
    if slot == "rate":
        return {"linear": x, "quadratic": x**2}
    return {"exponential": -np.expm1(-x / max(inner, 1e-3)), "linear": x}


def _nearest(variable: Variable, fit: Fit, grid: np.ndarray, size: float) -> str | None:
    """Return the closed form with the least misfit, if that is usual of the uncertain function.

    Where it stands at the knots decides, inside of what was measured, weighed by its covariance.
    """
    k = _KNOTS
    x = np.linspace(grid[0], grid[-1], k + 1)[1:]
    basis = size * variable.basis(x)
    assert fit.covariance is not None
    covariance = basis @ fit.covariance[-k:, -k:] @ basis.T
    # a bend between two knots is told to a twentieth of the curve
    covariance += (_RESOLVED * np.max(np.abs(basis @ fit.linear[-k:]))) ** 2 * np.eye(k)
    root = np.linalg.inv(np.linalg.cholesky(covariance))
    target, best = root @ basis @ fit.linear[-k:], (np.inf, "")
    for inner in np.linspace(0.02, 1.2, _TRIED):
        for name, form in _forms(variable.slot, x / variable.largest, inner).items():
            own = root @ form
            square = float(own @ own)
            left = target - own * (own @ target) / square if square else target
            best = min(best, (float(left @ left), name))
    return best[1] if best[0] < chi2.ppf(_USUAL, k - 2) else None
