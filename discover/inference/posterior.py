"""Posterior over hypotheses: probabilities, constants, and bands of what was not fitted."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from jaxtyping import Float
from scipy.special import expit

from discover.inference.bands import Band, Predictions, quantiles
from discover.inference.discrepancy import DiscrepancyModel
from discover.inference.fits import Fit, Fitter
from discover.inference.free_form import FreeFunction
from discover.inference.indistinguishable import Indistinguishable, indistinguishable
from discover.inference.left_out import (
    FEWEST_RUNS,
    left_out,
    predictive_mixture,
    screened_to_first_order,
)
from discover.inference.noise import LEAST
from discover.inference.problem import LOG_ODDS_OF_NONE, Problem
from discover.inference.rows import Rows
from discover.inference.search import Search, refitted
from discover.processor import in_one_thread
from discover.statistics.whiteness import FEWEST_TESTED, smooth_misfit_probability

_NEGLIGIBLE = 1e-3
"""Probability below which nothing is made of it that none of the hypotheses is all there is."""

WINDOW = 12.0
"""Log odds below the best from which on a hypothesis counts no longer."""

UNLIKE_NOISE = 0.02
"""Prior probability of a smooth misfit of another kind than the curves: of one that noise has once
in a thousand times it makes even odds."""

_SEEN = 3.0
"""Of the noise that is always there, what a run leaves to be tested for noise."""

_MOST = 8
_WITH_DISCREPANCY = 2
"""So many of the likeliest hypotheses are asked what they leave."""

_SIZES = 400
"""Draws of the size of a discrepancy."""

_SEED = 20261128


@dataclass(frozen=True)
class Discrepancy:
    """Size of what no law describes, over the root mean square of the records, without noise.

    `size`, `ci95`: of all runs in the range. `by_run`: by name of the run. `grows_with_rate`: power
    of the shear rate with which it grows; None where the data do not tell. `unseen`: ``unseen
    runs`` where it is the error of such; empty: of fitted ones. `met_up_to`: rate up to which each
    run meets the tolerance; empty where all or none do.
    """

    size: float
    ci95: tuple[float, float]
    by_run: Mapping[str, float] = field(default_factory=dict)
    grows_with_rate: float | None = None
    unseen: str = ""
    met_up_to: str = ""


@dataclass
class Posterior:
    """What records say of a problem.

    `problem`: the records, the model and the candidates. `search`: hypotheses fitted to the runs
    that are fitted. `explanations`: with their probabilities, the likeliest first. `unexplained`:
    probability that none of them is all that is there. `fits`: hypotheses that are possible, fitted
    to the fitted runs, with their probabilities. `left`: what the likeliest hypothesis leaves of
    the fitted runs; None where none can be followed. `predictive_mixture`: hypotheses to rely on
    where none is all there is, as they predict fitted runs that are left out, with their weights.
    `curves`: functions of one variable that are possible beside hypotheses, and have no name.
    """

    problem: Problem
    search: Search
    explanations: tuple[Indistinguishable, ...]
    unexplained: float
    fits: tuple[tuple[Fit, float], ...]
    left: DiscrepancyModel | None
    predictive_mixture: tuple[tuple[Fit, float], ...] = ()
    curves: tuple[FreeFunction, ...] = ()
    memory: dict = field(default_factory=dict)

    @property
    def verdict(self) -> Literal["unexplained", "effects_added", "no_effect_needed"]:
        """What is to be believed."""
        if self.unexplained >= 0.5 or not self.explanations:
            return "unexplained"
        return "effects_added" if self.explanations[0].members[0] else "no_effect_needed"

    @property
    def weighted_hypotheses(self) -> tuple[tuple[Fit, float], ...]:
        """Hypotheses that are possible and those that predict best, the weightiest first."""
        none = self.unexplained if self.predictive_mixture else 0.0
        found: dict[int, tuple[Fit, float]] = {}
        for share, fits in ((1.0 - none, self.fits), (none, self.predictive_mixture)):
            for fit, weight in fits:
                found[id(fit)] = fit, share * weight + found.get(id(fit), (fit, 0.0))[1]
        return tuple(sorted(found.values(), key=lambda pair: -pair[1]))

    @property
    def best_predictive_laws(self) -> list[tuple[Fit, float]]:
        """Laws that predict runs left out best, for where none is all there is, with curves."""
        return self.mixed_with_curves(self.predictive_mixture or self.fits)

    def with_curves(self, curves: Sequence[FreeFunction]) -> "Posterior":
        """Return the posterior with functions among what may be there and has no name."""
        share = float(expit(-np.logaddexp.reduce([curve.weight for curve in curves])))
        explanations = tuple(
            replace(one, probability=share * one.probability) for one in self.explanations
        )
        unexplained = 1.0 - share * (1.0 - self.unexplained)
        return replace(
            self, explanations=explanations, unexplained=unexplained, curves=tuple(curves)
        )

    def mixed_with_curves(self, laws: Sequence[tuple[Fit, float]]) -> list[tuple[Fit, float]]:
        """Return laws for where none is all there is, and those with a function beside them.

        These count by the fitted runs, as far as they stand out beyond functions that only stand
        for an unknown law, and leave nothing. `laws`: with weights that add up to one.
        """
        odds = [curve.reliance for curve in self.curves]
        law, *of_curves = np.exp(np.array([0.0, *odds]) - np.logaddexp.reduce([0.0, *odds]))
        found = [(fit, float(law * weight)) for fit, weight in laws]
        for curve, weight in zip(self.curves, of_curves, strict=True):
            found += [(fit, float(weight * share)) for fit, share in curve.fits]
        return found

    def fitter_of(self, fit: Fit) -> Fitter:
        """Return what fitted a hypothesis, with a function beside it or without."""
        for curve in self.curves:
            if any(one is fit for one, _ in curve.fits):
                return curve.fitter
        return self.search.fitter

    def has_function(self, fit: Fit) -> bool:
        """Return whether a hypothesis has a function beside it."""
        return self.fitter_of(fit) is not self.search.fitter

    def interval(self, position: int) -> tuple[float, float] | None:
        """Return the 95 % interval of a constant, over the hypotheses in which it is free."""
        parts = []
        for fit, probability in self.weighted_hypotheses:
            if position in fit.priors and fit.covariance is not None:
                at = fit.free.index(position)
                parts.append(
                    (probability, fit.coordinates[at], fit.covariance[at, at], fit.priors[position])
                )
        if not parts:
            return None
        weights, middles, variances = (np.array([p[i] for p in parts]) for i in range(3))
        ends = quantiles(weights, middles[:, None], variances[:, None], (0.025, 0.975))
        prior = parts[0][3]
        low, high = (prior.to_value(np.clip(e[0], *prior.ends)) for e in ends)
        return low, high

    @in_one_thread
    def discrepancy(self) -> Discrepancy | None:
        """Return how large what no hypothesis holds is; None where none can be followed.

        It is no smaller than what fitted runs are missed by that are left out in turn, and it is
        zero where a hypothesis is all there is.
        """
        if self.left is None:
            return None
        lot, fit = np.random.default_rng(_SEED), self.left.fit
        drawn = self.left.sizes(_SIZES, lot)
        missed, runs = self.missed(fit), drawn.shape[1]
        usual = np.sqrt(np.mean(missed**2) * runs / lot.chisquare(runs, _SIZES))
        of_all = np.maximum(np.sqrt(np.mean(drawn**2, axis=1)), usual)
        there = lot.random(_SIZES) < self.unexplained
        size, low, high = np.quantile(np.where(there, of_all, 0.0), (0.5, 0.025, 0.975))
        growth = [(m.growth, np.exp(m.log_weight)) for m in self.left.members if m.curve]
        weight = sum(w for _, w in growth)
        by_run = np.maximum(np.median(drawn, axis=0), missed) if self.unexplained > 0.5 else 0.0
        names = [run.name for run in self.problem.fitted.runs]
        return Discrepancy(
            float(size),
            (float(low), float(high)),
            dict(zip(names, np.broadcast_to(by_run, runs).tolist(), strict=True)),
            sum(g * w for g, w in growth) / weight if weight > 0.5 else None,
        )

    def missed(self, fit: Fit) -> Float[np.ndarray, " runs"]:
        """Return by how much more than noise each fitted run is missed that is left out of a fit.

        Over its size.
        """
        if "missed" not in fit.memory:
            fitter = self.fitter_of(fit)
            # no fit predicts the only run: what its own leaves is then the least
            alone = len(fitter.rows.runs) < 2
            fit.memory["missed"] = (
                np.array([fitter.misfit(fit)]) if alone else left_out(fitter, [fit])[0]
            )
        return np.sqrt(np.maximum(fit.memory["missed"] ** 2 - fit.noise.common**2, 0.0))

    @in_one_thread
    def bands(self, rows: Rows) -> list[Band | None]:
        """Return the bands of runs with their noise, by the fitted runs alone."""
        return Predictions(self, rows, noise=True).bands(self.best_predictive_laws)


@in_one_thread
def posterior_of(
    search: Search, before: Posterior | None = None, whole: Search | None = None
) -> Posterior:
    """Return the posterior over hypotheses that were fitted, wherever they come from.

    `before`: the posterior of the same search before others were added, of which is kept what these
    do not change. `whole`: by all runs, where that is known.
    """
    done = {} if before is None else before.memory
    problem, near = search.problem, occams_window(search)
    whole = whole or refitted_to_all_runs(search, done["whole"][0] if done else None)
    judged = near if whole is search else whole.ranked()
    logs = np.array([whole.rank(fit) for fit in judged])
    beside = [_discrepancy_beside(whole, fit) for fit in judged[:_WITH_DISCREPANCY]]
    nothing = [whole.rank(one.fit) + one.log_factor + LOG_ODDS_OF_NONE for one in beside]
    nothing += [
        whole.rank(fit) + _log_odds_of_smooth_misfit(whole.fitter, fit) for fit in judged[:1]
    ]
    total = float(np.logaddexp.reduce([*logs, *nothing]))
    explanations, lost = indistinguishable(problem, whole, judged, np.exp(logs - total))
    unexplained = float(np.exp(np.logaddexp.reduce(nothing) - total)) + lost if nothing else 1.0
    # constants and bands are those of the fitted runs
    own = np.array([search.rank(fit) for fit in near])
    among = float(np.logaddexp.reduce(own))
    share = np.exp(own - among)
    fits = tuple((fit, float(p)) for fit, p in zip(near, share, strict=True))
    found = Posterior(problem, search, explanations, unexplained, fits, None)
    found.memory |= {**done, "whole": (whole, judged, beside)}
    if not near:
        return found
    found.left = left = _discrepancy_beside(search, near[0])
    none = own[0] + np.logaddexp(
        left.log_factor + LOG_ODDS_OF_NONE, _log_odds_of_smooth_misfit(search.fitter, near[0])
    )
    enough = len(problem.fitted.runs) >= FEWEST_RUNS and unexplained > _NEGLIGIBLE
    # runs held out may be what is unexplained: then evidence of the fitted ones stays as it is
    if enough and none > among:
        found.predictive_mixture = _predictive_mixture(found)
        fit = found.weighted_hypotheses[0][0]
        if fit is not near[0]:
            found.left = _discrepancy_beside(search, fit)
    return found


def occams_window(search: Search) -> list[Fit]:
    """Return hypotheses that count beside the likeliest, which comes first."""
    alive = search.ranked()
    return [fit for fit in alive if search.rank(fit) > search.rank(alive[0]) - WINDOW][:_MOST]


def refitted_to_all_runs(search: Search, done: Search | None = None) -> Search:
    """Return what is likely by the fitted runs, fitted to all, those too that are to be predicted.

    These judge: where the likeliest leaves something of all, nothing else is looked for that may
    leave less, and where it leaves nothing, what is as good. `done`: what was fitted to all before,
    beside which others come.
    """
    problem, fits = search.problem, occams_window(search)
    if problem.predicted is None:
        return search
    wanted = [*fits, search.found[frozenset()]]
    if done is None:
        runs = [*problem.fitted.runs, *problem.predicted.runs]
        done = refitted(wanted, Fitter(problem, Rows.of(runs)))
    else:
        new = [fit for fit in wanted if frozenset(fit.names) not in done.found]
        if not new:
            return done
        done = done.copied()
        done.add([done.fitter.start(fit.names, fit.theta) for fit in new])
    alive = done.backwards().ranked()
    if alive and _discrepancy_beside(done, alive[0]).log_factor + LOG_ODDS_OF_NONE < 0.0:
        done.exchange()
    return done


def _discrepancy_beside(search: Search, fit: Fit) -> DiscrepancyModel:
    """Return what a hypothesis leaves; one that is known if nothing has changed."""
    least, known = smallest(search, fit), fit.memory.get("left")
    if known is None or known.fit is not fit or known.smallest != least:
        known = fit.memory["left"] = DiscrepancyModel(search.fitter, fit, least)
    return known


def _log_odds_of_smooth_misfit(fitter: Fitter, fit: Fit) -> float:
    """Return the log odds of a smooth misfit that no curve follows, and noise would be slow.

    Of all tests of noise only this one speaks of the fluid: noise that was rounded, smoothed or
    hums is no first-order noise either. A probability p as noise speaks against it by a factor of
    −1/(e p ln p) at most   [Sellke, Bayarri & Berger 2001, Am. Stat. 55, 62].
    """
    rows = fitter.rows
    left = (fitter.record(fit) - rows.recorded) / rows.size
    # not of runs that leave no more than the noise that is always there
    loud = np.flatnonzero(rows.rms_by_run(left) > _SEEN * LEAST)
    rows = [row for run in loud if len(row := left[rows.run == run]) >= FEWEST_TESTED]
    p = smooth_misfit_probability(rows) if rows else 1.0
    if p >= np.exp(-1.0):
        return -np.inf
    p = max(p, 1e-300)
    return float(np.log(-1.0 / (np.e * p * np.log(p)) - 1.0) + np.log(UNLIKE_NOISE))


def _predictive_mixture(posterior: Posterior) -> tuple[tuple[Fit, float], ...]:
    """Return what predicts runs left out best, of what can be followed in the runs to predict."""
    search, rows = posterior.search, posterior.problem.predicted
    first = screened_to_first_order(search.fitter, search.ranked())
    if rows is not None:
        first = Predictions(posterior, rows).followed(first) or first
    return predictive_mixture(search.fitter, first)


def smallest(search: Search, fit: Fit) -> float:
    """Return what the least effect of a hypothesis takes away, over the noise."""
    count = len(search.fitter.noise.kept)
    found = [np.inf]
    for other in search.found.values():
        inside = set(other.names) < set(fit.names) and len(other.names) == len(fit.names) - 1
        if inside and np.isfinite(other.log_likelihood):
            gain = np.clip(2.0 * (fit.log_likelihood - other.log_likelihood) / count, 0.0, 20.0)
            found.append(float(np.sqrt(np.expm1(gain))))
    return min(found)
