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
from discover.inference.engine.discrepancy import Discrepancy
from discover.inference.engine.fits import Fit, Fitter
from discover.inference.engine.free_form import FreeForm, FreeFunction
from discover.inference.engine.posterior import NEAR, WINDOW, Posterior
from discover.inference.engine.problem import TERM_ODDS, Problem
from discover.inference.engine.search import Search
from discover.inference.engine.variables import Response, variables
from discover.inference.engine.with_function import SLIPS, WIDTHS, WithFunction, WithSlip
from discover.linear_algebra_threads import in_one_thread

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
    """Return the functions that are possible beside all other explanations, the likeliest first.

    They are tried beside hypotheses of few effects: a larger one may have taken up what they are.
    A small one may have too, so what is possible is fitted beside all of these.
    """
    search, problem, left = posterior.search, posterior.problem, posterior.left
    rows = search.fitter.rows
    if left is None or not all(
        r.protocol.control == "rate" and r.flow == "shear" for r in rows.runs
    ):
        return []
    fits = [f for f in search.found.values() if f.covariance is not None and not f.at_an_end]
    fits.sort(key=lambda fit: -fit.log_likelihood)
    bases = [
        [fit for fit in fits if len(fit.names) == size][:_BASES]
        for size in range(_LARGEST_BASE + 1)
    ]
    # effects by name that the search passed over, for beside a function others are likely
    known = {fit.names for fit in bases[1]}
    named = [effect.name for effect in problem.candidates if not isinstance(effect, LibraryTerm)]
    single = [search.fitter.start((name,), problem.zero) for name in named if (name,) not in known]
    whole, _, discrepancies = posterior.memory["whole"]
    other, in_all = _likeliest(search, [left]), _likeliest(whole, discrepancies)
    prior, found = problem.log_odds_of(TERM_ODDS), []

    def rank_of(fit: Fit) -> float:
        return search.rank(fit) + prior

    functions: list[list[WithFunction | WithSlip]] = [
        [WithFunction(search.fitter, variable, width) for width in WIDTHS]
        for variable in variables(rows)
    ]
    functions.append([WithSlip(search.fitter, width) for width in SLIPS])
    for one in (_starts(search.fitter, some, [*chain(*bases)]) for some in functions):
        fitted = [(fitter, fit) for fitter, starts in one for fit in fitter.fit(starts, wanted=1)]
        if not fitted:
            continue
        fitter, fit = max(fitted, key=lambda pair: rank_of(pair[1]))
        if rank_of(fit) - other < _WORTH_IT:
            continue
        starts = [fitter.beside(base, fit) for base in chain(*bases)]
        curves = [fit, *fitter.fit(starts, wanted=1, known=[fit])]
        if max(map(rank_of, curves)) > other:  # of which those that start far away are worth it
            curves += fitter.fit([fitter.beside(base, fit) for base in single])
        fit, reported = max(curves, key=rank_of), fitter
        odds, again = -np.inf, fitter.on(whole.fitter)
        if again is not None:
            (refit,) = again.fit([again.start(fit.names, fit.theta)])
            odds = refit.log_evidence - fit.log_evidence
        weighed = _weighed(curves, rank_of)
        if isinstance(fitter, WithFunction) and not isinstance(fitter.variable, Response):
            closed, known = fitter.closed([one for one, _ in weighed[:_LAWS]])
            if max(map(rank_of, known), default=-np.inf) > rank_of(fit):
                fitter, weighed = closed, _weighed(known, rank_of)
        rank = rank_of(weighed[0][0])
        odds += rank - in_all
        if max(rank - other, odds) > _POSSIBLE:
            variable, (grid, value, half), nearest = reported.curve(fit)
            # a function may take up what an effect does, or an effect what it does
            likely = [one.names for one, _ in weighed if rank_of(one) > rank - NEAR]
            beside = min((one for one in likely if set(one) <= set(likely[0])), key=len)
            law = next(one for one, _ in weighed if one.names == beside)
            form = FreeForm(
                variable.slot, variable.name, variable.unit, beside,
                grid, value, value - half, value + half, nearest, _constants(problem, law),
            )  # fmt: skip
            left = Discrepancy(fitter, weighed[0][0]) if rank > other else None
            log_odds = float(rank - other), float(odds)
            found.append(FreeFunction(form, weighed, fitter, *log_odds, left))
    return sorted(found, key=lambda one: -one.log_odds)


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


def _likeliest(search: Search, discrepancies: Sequence[Discrepancy]) -> float:
    """Return the largest log of evidence times prior, with a discrepancy or without."""
    beside = [search.rank(one.fit) + one.log_factor for one in discrepancies]
    return max(*beside, *(search.rank(fit) for fit in search.alive()[:1]))


def _starts(
    fitter: Fitter, functions: Sequence[WithFunction | WithSlip], bases: Sequence[Fit]
) -> list[tuple[WithFunction | WithSlip, list[Fit]]]:
    """Return the most promising hypotheses with a function, scored to first order, by its width."""
    scored, widths = [], np.array([own.width for own in functions])
    for fit in bases:
        values, sizes = _first_order(fitter, fit, functions[0].signatures(fit), widths)
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
    assert fit.covariance is not None
    record, k = fitter.record(fit), signatures.shape[1]
    columns = np.column_stack([fit.jacobian, signatures])
    both = np.column_stack([columns, fitter.rows.recorded - record])
    white = fitter.noise.whitened(both, record, fit.noise)
    curvature = white[:, :-1].T @ white[:, :-1]
    curvature[:-k, :-k] = np.linalg.inv(fit.covariance)
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
