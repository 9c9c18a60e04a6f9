"""Posterior over hypotheses: probabilities, constants, and bands of what was not fitted."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float
from scipy.special import logsumexp, ndtr
from scipy.stats import t as student

from discover.effects.library_term import LibraryTerm
from discover.inference.engine.discrepancy import Discrepancy
from discover.inference.engine.fits import Fit, Fitter
from discover.inference.engine.problem import Problem
from discover.inference.engine.rows import Rows
from discover.inference.engine.search import Search, refitted
from discover.linear_algebra_threads import in_one_thread

NONE = 0.3
"""Prior probability that something has no name; on development seeds of judged worlds anything from
0.2 to 0.5 is as good, and records that cannot tell are not called unexplained."""

WINDOW = 12.0
"""Log odds below the best from which on a hypothesis counts no longer."""

_MOST = 8
_WITH_DISCREPANCY = 2
"""So many of the likeliest hypotheses are asked what they leave."""

SAME = 0.3
"""Root mean square of a difference of predictions over the noise, below which no test of these
runs can tell two hypotheses apart."""

_NEAR = 6.0
_NAMELESS = 0.5
"""Share that a term without a law keeps: it is as likely the first of a law nobody wrote down."""

_RUNS_AWAY = 10.0
"""Times the size of the largest record, which no sound prediction of another run exceeds."""

_LEFT_OUT_ROUNDS = 5

_MOST_MISSED = 1.0
"""Over the size of a run: by more nothing is missed that is called a prediction."""

_DRAWS = 12
"""Pairs of draws of the constants of a hypothesis."""

_SIZES = 400
"""Draws of the size of a discrepancy."""

_SEED = 20261128


@dataclass(frozen=True)
class Explanation:
    """Hypotheses that these records cannot tell apart, the likeliest first."""

    members: tuple[tuple[str, ...], ...]
    probability: float


@dataclass(frozen=True)
class Band:
    """A prediction of one run with its 95 % band, in Pa; all of shape (n,)."""

    middle: Float[np.ndarray, " n"]
    low: Float[np.ndarray, " n"]
    high: Float[np.ndarray, " n"]


@dataclass(frozen=True)
class Size:
    """How large a discrepancy is, over the root mean square of the records.

    Attributes
    ----------
    size, ci95
        Of all fitted runs.
    by_run
        By name of the run.
    grows_with_rate
        Power of the shear rate with which it grows, if the records tell.
    """

    size: float
    ci95: tuple[float, float]
    by_run: dict[str, float]
    grows_with_rate: float | None


@dataclass
class Posterior:
    """What records say of a problem.

    Attributes
    ----------
    problem
        The records, the model and the candidates.
    search
        Hypotheses fitted to the runs that are fitted.
    explanations
        With their probabilities, the likeliest first.
    unexplained
        Probability that none of them is all that is there.
    fits
        Hypotheses that are possible, fitted to the fitted runs, with their probabilities.
    left
        What the likeliest hypothesis leaves of the fitted runs; None where none can be followed.
    """

    problem: Problem
    search: Search
    explanations: tuple[Explanation, ...]
    unexplained: float
    fits: tuple[tuple[Fit, float], ...]
    left: Discrepancy | None
    memory: dict = field(default_factory=dict)

    @property
    def verdict(self) -> str:
        """``unexplained``, ``effects_added`` or ``no_effect_needed``."""
        if self.unexplained >= 0.5 or not self.explanations:
            return "unexplained"
        return "effects_added" if self.explanations[0].members[0] else "no_effect_needed"

    def interval(self, position: int) -> tuple[float, float] | None:
        """Return the 95 % interval of a constant, over the hypotheses in which it is free."""
        parts = []
        for fit, probability in self.fits:
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
    def discrepancy(self) -> "Size | None":
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
        return Size(
            float(size),
            (float(low), float(high)),
            dict(zip(names, np.broadcast_to(by_run, runs).tolist(), strict=True)),
            sum(g * w for g, w in growth) / weight if weight > 0.5 else None,
        )

    def missed(self, fit: Fit) -> Float[np.ndarray, " runs"]:
        """Return by how much of its size each fitted run is missed that is left out of a fit."""
        if "missed" not in fit.memory:
            fit.memory["missed"] = left_out(self.search.fitter, fit)
        return fit.memory["missed"]

    @in_one_thread
    def bands(self) -> list[Band]:
        """Return the bands of the predicted runs, by the fitted runs alone.

        Hypotheses are weighed by their evidence. Where none is all there is, each misses a run as
        it misses fitted ones that are left out in turn.
        """
        rows = self.problem.predicted
        if rows is None:
            return []
        parts = Predictions(self, rows).parts()
        if not parts:
            return []
        weights = np.array([p[0] for p in parts])
        middle, variance = (np.array([p[i] for p in parts]) for i in (1, 2))
        low, mid, high = quantiles(weights, middle, variance, (0.025, 0.5, 0.975))
        return [
            Band(mid[rows.run == i], low[rows.run == i], high[rows.run == i])
            for i in range(len(rows.runs))
        ]


@in_one_thread
def explain(problem: Problem, most: int = 3, say: Callable[[str], None] | None = None) -> Posterior:
    """Return the posterior of a problem, hypotheses being sets of up to so many effects.

    Parameters
    ----------
    problem
        Records, model and candidates.
    most
        Effects in one set.
    say
        Called with a line of text now and then.
    """
    search = Search(Fitter(problem, problem.fitted), most, say).run()
    alive = search.alive()
    best = search.rank(alive[0]) if alive else 0.0
    near = [fit for fit in alive if search.rank(fit) > best - WINDOW][:_MOST]
    whole, judged = search, near
    if problem.predicted is not None:
        every = Rows.of([*problem.fitted.runs, *problem.predicted.runs])
        whole = refitted([*near, search.found[frozenset()]], Fitter(problem, every))
        whole.backwards().exchange()
        judged = whole.alive()
    logs = np.array([whole.rank(fit) for fit in judged])
    beside = [
        Discrepancy(whole.fitter, fit, smallest(whole, fit)) for fit in judged[:_WITH_DISCREPANCY]
    ]
    nothing = [whole.rank(one.fit) + one.log_factor + np.log(NONE / (1.0 - NONE)) for one in beside]
    total = logsumexp([*logs, *nothing])
    explanations, lost = _classes(problem, whole, judged, np.exp(logs - total))
    unexplained = float(np.exp(logsumexp(nothing) - total)) + lost if nothing else 1.0
    # constants and bands are those of the fitted runs
    own = np.array([search.rank(fit) for fit in near])
    share = np.exp(own - logsumexp(own)) if len(own) else own
    left = Discrepancy(search.fitter, near[0], smallest(search, near[0])) if near else None
    fits = tuple((fit, float(p)) for fit, p in zip(near, share, strict=True))
    found = Posterior(problem, search, explanations, unexplained, fits, left)
    found.memory["whole"] = whole, judged, beside
    return found


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


def _classes(
    problem: Problem, search: Search, fits: Sequence[Fit], probability: np.ndarray
) -> tuple[tuple[Explanation, ...], float]:
    """Return classes of hypotheses with the same predictions, and what nameless terms lose."""
    fitter, classes = search.fitter, []
    for fit, p in zip(fits, probability, strict=True):
        record, rank = fitter.record(fit), search.rank(fit)
        for one in classes:
            off = (record - one["record"]) / (one["noise"] * fitter.rows.size)
            if np.sqrt(np.mean(off**2)) < SAME and rank > one["rank"] - _NEAR:
                one["members"].append(fit.names)
                one["p"] += p
                break
        else:
            noise = fit.noise.sizes[fitter.rows.run]
            classes.append(
                {"record": record, "noise": noise, "rank": rank, "members": [fit.names], "p": p}
            )
    found, lost = [], 0.0
    for one in classes:
        share = float(one["p"])
        if all(_has_term(problem, names) for names in one["members"]):
            lost += (1.0 - _NAMELESS) * share
            share *= _NAMELESS
        found.append(Explanation(_smallest_sets(one["members"]), share))
    return tuple(sorted(found, key=lambda one: -one.probability)), lost


def _smallest_sets(members: Sequence[tuple[str, ...]]) -> tuple[tuple[str, ...], ...]:
    """Return sets of which no part predicts the same: what is added to these changes nothing."""
    sets = [set(names) for names in members]
    return tuple(
        names
        for names, own in zip(members, sets, strict=True)
        if not any(other < own for other in sets)
    )


def _has_term(problem: Problem, names: Sequence[str]) -> bool:
    return any(isinstance(problem.effects[name], LibraryTerm) for name in names)


class Predictions:
    """Normal predictions of rows that were not fitted, one for each hypothesis."""

    def __init__(self, posterior: Posterior, rows: Rows):
        self.posterior, self.rows = posterior, rows
        self.problem = posterior.problem
        self.fitter = Fitter(self.problem, rows)
        self._largest = _RUNS_AWAY * float(np.max(np.abs(self.problem.fitted.recorded)))

    def parts(self) -> list[tuple[float, np.ndarray, np.ndarray]]:
        """Return weight, mean and variance of the rows, of each hypothesis."""
        found: list[tuple[float, np.ndarray, np.ndarray]] = []
        explained = 1.0 - self.posterior.unexplained
        sound = [(f, p) for f, p in self.posterior.fits if self._ahead(f) is not None]
        if not sound:  # where all that are likely run away, the likeliest that does not
            others = self.posterior.search.alive()
            sound = [(f, 1.0) for f in others if self._ahead(f) is not None][:1]
        total = sum(p for _, p in sound)
        for fit, probability in sound:
            share = probability / total
            if explained * share > 1e-4:
                found.append((explained * share, *self._of_fit(fit)))
            if (1.0 - explained) * share > 1e-3:
                found.append(((1.0 - explained) * share, *self._of_none(fit)))
        return found

    def _ahead(self, fit: Fit) -> Float[np.ndarray, " rows"] | None:
        """Return what the model of a fit predicts; None where it runs away."""
        if "ahead" not in fit.memory:
            predicted = self.fitter.predict([fit.theta])[0]
            with np.errstate(invalid="ignore"):
                sound = bool(np.all(np.abs(predicted) < self._largest))
            fit.memory["ahead"] = predicted if sound else None
        return fit.memory["ahead"]

    def _jacobian(self, fit: Fit, predicted: np.ndarray):
        """Return derivatives of the rows, and the variance of what each run has of its own."""
        if "jacobian" in fit.memory:
            return fit.memory["jacobian"]
        ahead = self.fitter.start(fit.names, fit.theta)
        ahead.predicted = predicted
        self.fitter.linearise([ahead])
        assert ahead.jacobian is not None
        own = ahead.jacobian[:, : len(fit.priors)]
        # of what is linear, only the gain and the moduli are those of the fitted runs
        runs, q = len(self.problem.fitted.runs), len(fit.linear)
        linear, each = self.fitter.linear_columns(predicted), 2 + bool(self.problem.loading)
        shared = np.zeros((len(self.rows), q))
        shared[:, 0] = linear[:, 0]
        shared[:, 1 + each * runs :] = linear[:, 1 + each * len(self.rows.runs) :]
        alone = slice(1, 1 + each * len(self.rows.runs))
        apart = np.sum((linear[:, alone] * self.fitter.widths[alone]) ** 2, axis=1)
        found = np.column_stack([own * (1.0 + fit.linear[0]), shared]), apart
        fit.memory["jacobian"] = found
        return found

    def _of_fit(self, fit: Fit) -> tuple[np.ndarray, np.ndarray]:
        predicted = self._ahead(fit)
        assert predicted is not None
        assert fit.covariance is not None
        jacobian, apart = self._jacobian(fit, predicted)
        middle = predicted + jacobian[:, len(fit.priors) :] @ fit.linear
        variance = np.einsum("ij,jk,ik->i", jacobian, fit.covariance, jacobian) + apart
        noise = fit.noise.common * self.fitter.noise.deviation(middle, fit.noise.share)
        return middle, variance + noise**2

    def _of_none(self, fit: Fit) -> tuple[np.ndarray, np.ndarray]:
        """Return what a hypothesis says of the rows where it is not all there is.

        It misses them as it misses fitted runs that are left out in turn, by more where a run is
        faster. Constants are drawn, for to first order what is far would grow without bound.
        """
        predicted = self._ahead(fit)
        assert predicted is not None
        assert fit.covariance is not None
        root = np.linalg.cholesky(fit.covariance)[: len(fit.priors)]
        lot = np.random.default_rng(_SEED).standard_normal((_DRAWS, root.shape[1]))
        drawn = fit.coordinates + np.concatenate([lot, -lot]) @ root.T
        found = self.fitter.predict([fit.at(one) for one in drawn])
        sound = np.all(np.abs(np.nan_to_num(found, nan=np.inf)) < self._largest, axis=1)
        spread = np.mean((found[sound] - predicted) ** 2, axis=0) if np.any(sound) else 0.0
        _, apart = self._jacobian(fit, predicted)
        middle = predicted * (1.0 + fit.linear[0])
        noise = fit.noise.common * self.fitter.noise.deviation(middle, fit.noise.share)
        missed = self.missed(fit) * self.rows.size
        return middle, spread + apart + missed**2 + noise**2

    def missed(self, fit: Fit) -> Float[np.ndarray, " rows"]:
        """Return the deviation, over its size, by which each run may be missed."""
        missed, fastest = self.posterior.missed(fit), self.problem.fitted.fastest
        runs = len(missed)
        # as few runs tell a deviation badly: of the next one Student's quantile is the wider
        wider = student.ppf(0.975, max(runs - 1, 1)) / 1.96 * np.sqrt(1.0 + 1.0 / runs)
        # as far as the worst of them, and in proportion to the rate beyond the fastest
        size = np.max(missed) * np.maximum(self.rows.fastest / np.max(fastest), 1.0)
        return np.minimum(wider * size, _MOST_MISSED)[self.rows.run]


def left_out(whole: Fitter, fit: Fit) -> Float[np.ndarray, " runs"]:
    """Return by how much of its size each fitted run is missed when it is left out of the fit."""
    rows, problem, found = whole.rows, whole.problem, []
    for i in range(len(rows.runs)):
        fitter = whole.leaving_out(i)
        start = fitter.start(fit.names, fit.theta, fit.linear)
        # when a rate steps is read off its own record, and is no prediction
        own = [step.place for step in rows.runs[i].rate_steps if step.place is not None]
        held = {problem.model.instants.start + place for place in own}
        start.priors = {at: prior for at, prior in start.priors.items() if at not in held}
        part = fitter.fit([start], _LEFT_OUT_ROUNDS, derivatives=False)[0]
        at = rows.run == i
        with np.errstate(over="ignore", invalid="ignore"):  # without the run the law runs away
            off = (rows.recorded - part.predicted)[at] / rows.size[at]
            size = float(np.sqrt(max(float(np.mean(off**2)) - fit.noise.common**2, 0.0)))
        found.append(min(size, _MOST_MISSED) if np.isfinite(size) else _MOST_MISSED)
    return np.array(found)


def quantiles(
    weights: Float[np.ndarray, " parts"],
    middle: Float[np.ndarray, "parts n"],
    variance: Float[np.ndarray, "parts n"],
    probabilities: Sequence[float],
) -> list[Float[np.ndarray, " n"]]:
    """Return quantiles of mixtures of normal distributions, by bisection."""
    weights = weights / np.sum(weights)
    spread = np.sqrt(np.maximum(variance, 1e-300))
    out = []
    for probability in probabilities:
        low, high = np.min(middle - 9 * spread, axis=0), np.max(middle + 9 * spread, axis=0)
        for _ in range(50):
            half = 0.5 * (low + high)
            below = weights @ ndtr((half - middle) / spread) < probability
            low, high = np.where(below, half, low), np.where(below, high, half)
        out.append(0.5 * (low + high))
    return out
