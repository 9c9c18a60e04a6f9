"""Fits of hypotheses with a function of one variable beside them: curve, closed form or slip."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from jaxtyping import Float
from scipy.special import chdtri

from discover.inference.fits import Fit, Fitter
from discover.inference.linear_errors import LinearErrors
from discover.inference.priors import Deviations, Prior
from discover.inference.rows import Rows
from discover.inference.variables import (
    INNER,
    KNOTS,
    SLIP_CURVE,
    ClosedFormVariable,
    Variable,
    closed_forms,
    variables,
)
from discover.statistics import HALF_BAND

WIDTHS = (0.03, 0.1, 0.3, 1.0, 3.0)
"""Standard deviations of a change of slope, both axes over their size."""

SLIPS = (0.1, 0.3)
"""The same of slip, over the typical rate and stress: it takes a tenth of the deformation or a
third."""

_SMALL = 1e-4
"""Of the typical fluidity: step of a difference."""

_POINTS = 61
_TRIED = 60
_FAINT = 0.5  # Of the width of a prior, the deviation from which on nothing is told
_SETTLED = 4  # Rounds after which an inner constant stands still
_USUAL = 0.95
_RESOLVED = 0.05


class _WithColumns(LinearErrors):
    """Linear errors of a bench and a function of one variable, the function last."""

    def __init__(self, errors: LinearErrors, variable: Variable, width: float):
        self.__dict__.update(vars(errors))
        self.variable, first = variable, len(errors)
        self.deviations = [
            *errors.deviations,
            (slice(first, first + variable.count), Deviations(width)),
        ]

    def columns(self, predicted, shifts):
        """Return what one of each does to the records, in Pa."""
        own = self.variable.columns(predicted)
        return np.column_stack([super().columns(predicted, shifts), own])

    def transducer_reading(self, predicted, sizes):
        """Return records by what transducers do and the function."""
        own = self.variable.columns(predicted) @ sizes[-self.variable.count :]
        return super().transducer_reading(predicted, sizes) + own

    def recorded(self, predicted, sizes, shifts):
        """Return records of trials, of what the model predicts of each."""
        own = [
            self.variable.columns(one) @ values[-self.variable.count :]
            for one, values in zip(predicted, sizes, strict=True)
        ]
        return super().recorded(predicted, sizes, shifts) + own

    def through(self, slopes, predicted, sizes):
        """Return derivatives of the records, of those of what the model predicts."""
        own = self.variable.change(slopes, predicted, sizes[-self.variable.count :])
        return super().through(slopes, predicted, sizes) + own


class WithFunction(Fitter):
    """Fits of hypotheses with a function of one variable beside them.

    `fitter`: what fits them without. `variable`, `width`: of the function: what it depends on, and
    how much its slope changes at a knot.
    """

    def __init__(self, fitter: Fitter, variable: Variable, width: float):
        self.__dict__.update(vars(fitter))
        self.bare, self.variable, self.width = fitter, variable, width
        self.errors = _WithColumns(fitter.errors, variable, width)

    def signatures(self, fit: Fit) -> Float[np.ndarray, "rows k"]:
        """Return what one of each change of slope does to the records, in Pa."""
        return self.variable.columns(fit.predicted)

    def errors_of(self, rows: Rows) -> LinearErrors:
        """Return what is linear in the records of other rows, with the function as it is here."""
        return _WithColumns(super().errors_of(rows), self.variable.at(rows), self.width)

    def on(self, fitter: Fitter) -> "WithFunction | None":
        """Return what fits the like to other rows; None where these have no such variable."""
        for variable in variables(fitter.rows):
            if variable.slot == self.variable.slot:
                return WithFunction(fitter, variable, self.width)
        return None

    def beside(self, base: Fit, fit: Fit) -> Fit:
        """Return another hypothesis with the function of a fit, before its first step."""
        return self.start(base.names, base.theta, fit.linear)

    def curve(self, fit: Fit) -> tuple[Variable, list[np.ndarray], str | None]:
        """Return the function, its grid, values and half band, and its closed form."""
        assert fit.covariance is not None
        variable, k = self.variable, KNOTS
        grid = variable.grid(fit.predicted, _POINTS)
        size = 1.0 if variable.is_factor else variable.scale
        sizes, covariance = fit.linear[-k:], fit.covariance[-k:, -k:]
        return _curve(variable, grid, lambda x: size * variable.basis(x), sizes, covariance)

    def closed(self, fits: Sequence[Fit]) -> "tuple[WithFunction, list[Fit]]":
        """Return hypotheses with the closed form that is nearest to the function of the first.

        It leaves less open than a curve with as many bends as this has.
        """
        variable, best = self.variable, fits[0]
        assert best.covariance is not None
        sizes, covariance = best.linear[-KNOTS:], best.covariance[-KNOTS:, -KNOTS:]
        x = variable.grid(best.predicted, KNOTS + 1)[1:]
        _, (form, inner, amount) = _nearest(variable, x, variable.basis(x), sizes, covariance)
        closed, start = ClosedFormVariable.of(variable, form, inner), np.array([amount, 0.0])
        fitter, found, q = self, list(fits), len(self.bare.errors)
        for _ in range(_SETTLED):
            last = WithFunction(self.bare, closed, WIDTHS[-1])
            fits = last.fit([
                last.start(fit.names, fit.theta, np.append(fit.linear[:q], start)) for fit in found
            ])  # fmt: skip
            if fitter is not self and fits[0].log_evidence < found[0].log_evidence:
                break
            fitter, found = last, fits
            closed, start = closed.moved(fits[0].linear[-2:]), fits[0].linear[-2:] * [1.0, 0.0]
        return fitter, [fit for fit in found if fitter.is_seen(fit)]

    def is_seen(self, fit: Fit) -> bool:
        """Return whether records tell how much there is of a closed form."""
        return fit.root is not None and bool(np.linalg.norm(fit.root[-2]) < _FAINT * self.width)


class WithSlip(Fitter):
    """Fits of hypotheses with slip beside them that is a function of the stress.

    `fitter`: what fits them without. `width`: how much the slope of the curve changes at a bend,
    over the typical rate and stress.
    """

    def __init__(self, fitter: Fitter, width: float):
        self.__dict__.update(vars(fitter))
        self._priors, self.width = {}, width
        self._at = list(self.problem.model.positions(SLIP_CURVE.name)[:-1])

    def signatures(self, fit: Fit) -> Float[np.ndarray, "rows k"]:
        """Return what one of each change of slope does to the records, in Pa."""
        step = _SMALL * self.problem.scales["fluidity"]
        thetas = np.tile(fit.theta, (len(self._at), 1))
        thetas[np.arange(len(self._at)), self._at] += step
        return (self.predict(thetas) - fit.predicted).T / _SMALL

    def on(self, fitter: Fitter) -> "WithSlip":
        """Return the same on other rows."""
        return WithSlip(fitter, self.width)

    def priors(self, names: Sequence[str]) -> Mapping[int, Prior]:
        """Return the priors of all that is free, those of the curve last."""
        own = Prior("normal", 0.0, self.width * self.problem.scales["fluidity"])
        return {**self.problem.priors(names), **dict.fromkeys(self._at, own)}

    def beside(self, base: Fit, fit: Fit) -> Fit:
        """Return another hypothesis with the function of a fit, before its first step."""
        theta = base.theta.copy()
        theta[self._at] = fit.theta[self._at]
        return self.start(base.names, theta, fit.linear)

    def curve(self, fit: Fit) -> tuple[Variable, list[np.ndarray], str | None]:
        """Return the function, its grid, values and half band, and its closed form."""
        assert fit.covariance is not None
        grid = np.linspace(0.0, float(np.max(np.abs(fit.predicted))), _POINTS)
        variable = Variable("slip", "stress", "Pa", None, float(grid[-1]), 1.0)
        at = [fit.free.index(position) for position in self._at]
        sizes, covariance = fit.theta[self._at], fit.covariance[np.ix_(at, at)]
        typical = self.problem.scales["stress"]
        return _curve(variable, grid, lambda x: SLIP_CURVE.basis(x, typical), sizes, covariance)


def _curve(
    variable: Variable,
    grid: Float[np.ndarray, " n"],
    basis_at: Callable[[np.ndarray], np.ndarray],
    sizes: Float[np.ndarray, " k"],
    covariance: Float[np.ndarray, "k k"],
) -> tuple[Variable, list[np.ndarray], str | None]:
    """Return a sum of columns with its grid, values and half 95 % band, and its closed form."""
    basis, x = basis_at(grid), np.linspace(grid[0], grid[-1], KNOTS + 1)[1:]
    spread = basis @ np.linalg.cholesky(covariance)
    half_band = HALF_BAND * np.sqrt(np.sum(spread**2, axis=1))
    nearest, _ = _nearest(variable, x, basis_at(x), sizes, covariance)
    return variable, [grid, basis @ sizes, half_band], nearest


def _nearest(
    variable: Variable,
    x: Float[np.ndarray, " n"],
    basis: Float[np.ndarray, "n k"],
    sizes: Float[np.ndarray, " k"],
    covariance: Float[np.ndarray, "k k"],
) -> tuple[str | None, tuple[str, float, float]]:
    """Return the closed form with the least misfit, if that is usual of the uncertain function.

    Where it stands at some points decides, inside of what was measured, weighed by its covariance.
    Behind it follow the form in any case, its inner constant, and how much of it there is.
    """
    values, covariance = basis @ sizes, basis @ covariance @ basis.T
    # a bend between two knots is told to a twentieth of the curve
    covariance += (_RESOLVED * np.max(np.abs(values))) ** 2 * np.eye(len(x))
    covariance += 1e-9 * np.trace(covariance) * np.eye(len(x))  # of a curve that is nothing
    root = np.linalg.inv(np.linalg.cholesky(covariance))
    target, best, least = root @ values, ("", 1.0, 0.0), np.inf
    for inner in np.linspace(*INNER, _TRIED):
        for name, form in closed_forms(variable.slot, x / variable.largest, inner).items():
            own = root @ form
            square = float(own @ own)
            amount = float(own @ target) / square if square else 0.0
            misfit = float(np.sum((target - own * amount) ** 2))
            if misfit < least:
                best, least = (name, float(inner), amount), misfit
    return best[0] if least < chdtri(len(x) - 2, 1.0 - _USUAL) else None, best
