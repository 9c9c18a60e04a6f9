"""Free functions: curves of one variable beside a hypothesis, for what has no name.

What a hypothesis leaves may be one function in all runs: of the stress, as of a transducer that
bends, of the time or the shear rate, or a factor that depends on the strain. Such a function is a
hypothesis like any other: changes of slope at a few knots, each normal about zero with one width
[Wahba 1978, J. R. Stat. Soc. B 40, 364], fitted together with the constants of the law and weighed
by the same evidence.
"""

from collections.abc import Callable, Sequence
from itertools import chain

import numpy as np
from jaxtyping import Float

from discover.effects.library_term import LibraryTerm
from discover.inference.discrepancy import DiscrepancyModel
from discover.inference.fits import Fit, Fitter
from discover.inference.free_form import FreeForm, FreeFunction
from discover.inference.indistinguishable import NEAR
from discover.inference.posterior import WINDOW, Posterior
from discover.inference.problem import TERM_ODDS, Problem
from discover.inference.search import Search
from discover.inference.variables import Response, variables
from discover.inference.with_function import SLIPS, WIDTHS, WithFunction, WithSlip
from discover.processor import in_one_thread

_BASES = 12
"""Hypotheses of each size beside which a function is tried to first order."""

_LARGEST_BASE = 2
_REFITTED = 2
"""Of all, so many of the likeliest to first order are fitted, and the likeliest of each size."""

_BEHIND = 30.0
"""Log odds behind the likeliest to first order from which on a hypothesis is not fitted."""

_POSSIBLE = -7.0
"""Log odds from which on a curve is among what is possible, shown or not."""

_WORTH_IT = -20.0
"""Log odds in the fitted runs from which on a curve is weighed in all runs."""

_LAWS = 4
"""Beside which a function of closed form is fitted."""


@in_one_thread
def free_functions(posterior: Posterior) -> list[FreeFunction]:
    """Return the functions that are possible beside all other explanations, the likeliest first."""
    fitter = posterior.search.fitter
    runs = fitter.rows.runs
    if posterior.left is None or not all(
        run.protocol.control == "rate" and run.flow == "shear" for run in runs
    ):
        return []
    functions: list[list[WithFunction | WithSlip]] = [
        [WithFunction(fitter, variable, width) for width in WIDTHS]
        for variable in variables(fitter.rows)
    ]
    functions.append([WithSlip(fitter, width) for width in SLIPS])
    laws = _Laws(posterior, posterior.left)
    found = [one for some in functions if (one := laws.with_likeliest(some)) is not None]
    return sorted(found, key=lambda one: -one.log_odds)


class _Laws:
    """Hypotheses of few effects beside which functions are tried, and what these are held against.

    A larger one may have taken up what a function is. A small one may have too, so that a function
    that is possible beside one is fitted beside all of these.

    `few`: the likeliest of each size. `others`: effects by name that the search passed over, which
    may be likely beside a function.
    """

    def __init__(self, posterior: Posterior, left: DiscrepancyModel):
        self.search, self.problem = posterior.search, posterior.problem
        fits = [
            fit
            for fit in self.search.found.values()
            if fit.covariance is not None and not fit.vanished
        ]
        fits.sort(key=lambda fit: -fit.log_likelihood)
        sizes = range(_LARGEST_BASE + 1)
        of_size = [[fit for fit in fits if len(fit.names) == size][:_BASES] for size in sizes]
        self.few = [*chain(*of_size)]
        tried = {fit.names for fit in self.few}
        self.others = [
            self.search.fitter.start((effect.name,), self.problem.zero)
            for effect in self.problem.candidates
            if not isinstance(effect, LibraryTerm) and (effect.name,) not in tried
        ]
        self.whole, _, discrepancies = posterior.memory["whole"]
        self.alone = _likeliest(self.search, [left])
        self.alone_in_all = _likeliest(self.whole, discrepancies)

    def rank(self, fit: Fit) -> float:
        """Return the log of evidence times prior of a law with a function."""
        return self.search.rank(fit) + self.problem.log_odds_of(TERM_ODDS)

    def with_likeliest(self, functions: Sequence[WithFunction | WithSlip]) -> FreeFunction | None:
        """Return the likeliest of functions of one variable; None where none is possible."""
        fitted = [
            (fitter, fit)
            for fitter, starts in _starts(self.search.fitter, functions, self.few)
            for fit in fitter.fit(starts, wanted=1)
        ]
        if not fitted:
            return None
        curve, fit = max(fitted, key=lambda pair: self.rank(pair[1]))
        if self.rank(fit) - self.alone < _WORTH_IT:
            return None
        fits = [
            fit,
            *curve.fit([curve.beside(law, fit) for law in self.few], wanted=1, known=[fit]),
        ]
        if max(map(self.rank, fits)) > self.alone:  # those that start far away are worth it too
            fits += curve.fit([curve.beside(law, fit) for law in self.others])
        fitter, weighed = curve, _weighed(fits, self.rank)
        fit, _ = weighed[0]
        gained = self._gained_in_all(curve, fit)
        if isinstance(curve, WithFunction) and not isinstance(curve.variable, Response):
            closed, known = curve.closed([one for one, _ in weighed[:_LAWS]])
            if max(map(self.rank, known), default=-np.inf) > self.rank(fit):
                fitter, weighed = closed, _weighed(known, self.rank)
        rank = self.rank(weighed[0][0])
        odds, in_all = rank - self.alone, rank + gained - self.alone_in_all
        if max(odds, in_all) < _POSSIBLE:
            return None
        form = self._form(curve, fit, weighed)
        left = DiscrepancyModel(fitter, weighed[0][0]) if odds > 0.0 else None
        return FreeFunction(form, weighed, fitter, float(odds), float(in_all), left)

    def _gained_in_all(self, fitter: WithFunction | WithSlip, fit: Fit) -> float:
        """Return how much larger the log evidence is of all runs than of the fitted ones."""
        again = fitter.on(self.whole.fitter)
        if again is None:
            return -np.inf
        (refit,) = again.fit([again.start(fit.names, fit.theta)])
        return refit.log_evidence - fit.log_evidence

    def _form(
        self,
        curve: WithFunction | WithSlip,
        fit: Fit,
        weighed: Sequence[tuple[Fit, float]],
    ) -> FreeForm:
        """Return a curve as the result shows it, of the law beside which it is the likeliest."""
        variable, (grid, value, half), nearest = curve.curve(fit)
        # a function may take up what an effect does, or an effect what it does
        best = self.rank(weighed[0][0])
        likely = [one for one, _ in weighed if self.rank(one) > best - NEAR]
        inside = (one for one in likely if set(one.names) <= set(likely[0].names))
        law = min(inside, key=lambda one: len(one.names))
        return FreeForm(
            variable.slot, variable.name, variable.unit, law.names,
            grid, value, value - half, value + half, nearest, _constants(self.problem, law),
        )  # fmt: skip


def _constants(problem: Problem, fit: Fit) -> dict[str, dict[str, tuple[float, float, float]]]:
    """Return the free constants of effects with the ends of their intervals, by name."""
    return {
        name: {
            one.name: (float(fit.theta[at]), *fit.interval(at))
            for one, at in zip(
                problem.effects[name].parameters, problem.model.positions(name), strict=True
            )
            if at in fit.priors
        }
        for name in fit.names
    }


def _weighed(fits: Sequence[Fit], rank_of: Callable[[Fit], float]) -> tuple[tuple[Fit, float], ...]:
    """Return the possible ones of some fits with their shares, one of each set of effects."""
    ordered = sorted(fits, key=rank_of)
    best = {fit.names: fit for fit in ordered if rank_of(fit) > rank_of(ordered[-1]) - WINDOW}
    total = np.logaddexp.reduce([rank_of(fit) for fit in best.values()])
    shares = ((fit, float(np.exp(rank_of(fit) - total))) for fit in best.values())
    return tuple(sorted(shares, key=lambda pair: -pair[1]))


def _likeliest(search: Search, discrepancies: Sequence[DiscrepancyModel]) -> float:
    """Return the largest log of evidence times prior, with a discrepancy or without."""
    beside = [search.rank(one.fit) + one.log_factor for one in discrepancies]
    return max(*beside, *(search.rank(fit) for fit in search.ranked()[:1]))


def _starts(
    fitter: Fitter, functions: Sequence[WithFunction | WithSlip], bases: Sequence[Fit]
) -> list[tuple[WithFunction | WithSlip, list[Fit]]]:
    """Return the most promising hypotheses with a function, scored to first order, by its width."""
    scored, widths = [], np.array([own.width for own in functions])
    for fit in bases:
        signatures = functions[0].signatures(fit)
        if not np.all(np.isfinite(signatures)):
            continue  # a step away the law runs away
        values, sizes = _first_order(fitter, fit, signatures, widths)
        for own, value, size in zip(functions, values, sizes, strict=True):
            # slip, which is not linear, starts from none: its first order may be far
            linear = np.append(fit.linear, size)[: len(own.errors)]
            scored.append((float(value), own, own.start(fit.names, fit.theta, linear)))
    scored.sort(key=lambda one: -one[0])
    chosen: dict[WithFunction | WithSlip, list[Fit]] = {}
    sizes_seen: set[int] = set()  # the best of each: far from none, first order favours large ones
    for place, (value, own, start) in enumerate(scored):
        is_wanted = place < _REFITTED or len(start.names) not in sizes_seen
        if is_wanted and value > scored[0][0] - _BEHIND:
            sizes_seen.add(len(start.names))
            chosen.setdefault(own, []).append(start)
    return list(chosen.items())


def _first_order(
    fitter: Fitter,
    fit: Fit,
    signatures: Float[np.ndarray, "rows k"],
    widths: Float[np.ndarray, " widths"],
) -> tuple[Float[np.ndarray, " widths"], Float[np.ndarray, "widths k"]]:
    """Return log evidence times prior of a hypothesis with a function of each width, and its sizes.

    By one step from where the hypothesis ended without the function.
    """
    assert fit.jacobian is not None
    assert fit.root is not None
    record, k = fitter.record(fit), signatures.shape[1]
    # along what is independent of each other, however unlike the sizes of the constants are
    columns = np.column_stack([fit.jacobian @ fit.root, signatures])
    both = np.column_stack([columns, fitter.rows.recorded - record])
    white = fitter.noise.whitened(both, record, fit.noise)
    curvature = white[:, :-1].T @ white[:, :-1]
    curvature[:-k, :-k] = np.eye(len(fit.root))
    curvature = np.tile(curvature, (len(widths), 1, 1))
    at = np.arange(curvature.shape[1] - k, curvature.shape[1])
    curvature[:, at, at] += 1.0 / widths[:, None] ** 2
    slope = white[:, :-1].T @ white[:, -1]
    slope[:-k] = 0.0  # at the maximum of the posterior without the function
    inverse = np.linalg.inv(curvature)
    step = inverse @ slope
    records = record + step @ columns.T
    values, _ = fitter.noise.log_likelihoods(fitter.rows.recorded - records, records)
    known = np.linalg.inv(inverse[:, -k:, -k:])
    values -= 0.5 * np.linalg.slogdet(known * widths[:, None, None] ** 2)[1]
    values -= 0.5 * np.sum((step[:, -k:] / widths[:, None]) ** 2, axis=1)
    return values + fitter.problem.log_prior(fit.names), step[:, -k:]
