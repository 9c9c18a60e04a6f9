"""Posterior over hypotheses: probabilities, constants, and bands of what was not fitted."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float
from scipy.special import logsumexp, ndtr

from discover.effects.library_term import LibraryTerm
from discover.inference.engine.discrepancy import Discrepancy
from discover.inference.engine.fits import Fit, Fitter
from discover.inference.engine.problem import Problem
from discover.inference.engine.rows import Rows
from discover.inference.engine.search import Search, refitted
from discover.linear_algebra_threads import in_one_thread

NONE = 0.5
"""Prior probability that something has no name; set on development seeds of judged worlds."""

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

_LEFT_OUT_ROUNDS = 4

_FAR = 0.5
"""Of the size of a run: what a discrepancy changes it by at most, in the mean and as a deviation."""


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
    discrepancies
        Of the likeliest hypotheses.
    """

    problem: Problem
    search: Search
    explanations: tuple[Explanation, ...]
    unexplained: float
    fits: tuple[tuple[Fit, float], ...]
    discrepancies: tuple[tuple[float, Discrepancy], ...]
    memory: dict = field(default_factory=dict)

    @property
    def verdict(self) -> str:
        """``unexplained``, ``effects_added`` or ``no_effect_needed``."""
        if self.unexplained >= 0.5 or not self.explanations:
            return "unexplained"
        return "effects_added" if self.explanations[0].members[0] else "no_effect_needed"

    @property
    def inclusion(self) -> dict[str, float]:
        """Probability of each effect, that something has no name being another answer."""
        found: dict[str, float] = {}
        for fit, probability in self.fits:
            for name in fit.names:
                found[name] = found.get(name, 0.0) + probability
        return found

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
    def bands(self) -> list[Band]:
        """Return the bands of the predicted runs, by the fitted runs alone."""
        rows = self.problem.predicted
        if rows is None:
            return []
        parts = _Predictions(self, rows).parts()
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
def explain(problem: Problem, most: int = 3) -> Posterior:
    """Return the posterior of a problem, hypotheses being sets of up to so many effects."""
    search = Search(Fitter(problem, problem.fitted), most).run()
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
    discrepancies = tuple(
        (float(own[i]), Discrepancy(search.fitter, fit, smallest(search, fit)))
        for i, fit in enumerate(near[:_WITH_DISCREPANCY])
    )
    fits = tuple((fit, float(p)) for fit, p in zip(near, share, strict=True))
    found = Posterior(problem, search, explanations, unexplained, fits, discrepancies)
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
        found.append(Explanation(tuple(one["members"]), share))
    return tuple(sorted(found, key=lambda one: -one.probability)), lost


def _has_term(problem: Problem, names: Sequence[str]) -> bool:
    return any(isinstance(problem.effects[name], LibraryTerm) for name in names)


class _Predictions:
    """Normal predictions of rows that were not fitted, one for each hypothesis."""

    def __init__(self, posterior: Posterior, rows: Rows):
        self.posterior, self.rows = posterior, rows
        self.problem = posterior.problem
        self.fitter = Fitter(self.problem, rows)

    def parts(self) -> list[tuple[float, np.ndarray, np.ndarray]]:
        """Return weight, mean and variance of the rows, of each hypothesis and discrepancy."""
        largest = _RUNS_AWAY * float(np.max(np.abs(self.problem.fitted.recorded)))
        found, search = [], self.posterior.search
        usable = []
        for fit, _ in self.posterior.fits:
            predicted = self.fitter.predict([fit.theta])[0]
            if np.all(np.isfinite(predicted)) and np.max(np.abs(predicted)) < largest:
                usable.append(fit)
                found.append((search.rank(fit), *self._of_fit(fit, predicted)))
        for rank, discrepancy in self.posterior.discrepancies:
            if discrepancy.fit in usable:
                log = rank + discrepancy.log_factor + np.log(NONE / (1.0 - NONE))
                found += [(log + w, *rest) for w, *rest in self._beside(discrepancy)]
        top = max((one[0] for one in found), default=0.0)
        return [(float(np.exp(w - top)), m, v) for w, m, v in found if w > top - 9.0]

    def _jacobian(self, fit: Fit, predicted: np.ndarray):
        """Return derivatives of the rows, and the fit's own coefficients of what is linear."""
        ahead = self.fitter.start(fit.names, fit.theta)
        ahead.predicted = predicted
        moved = self.fitter.predict(self.fitter._moved(ahead))
        own = self.fitter._columns(ahead, moved)[:, : len(fit.priors)]
        # of what is linear, only the gain and the moduli are those of the fitted runs
        runs, q = len(self.problem.fitted.runs), len(fit.linear)
        linear = self.fitter.linear_columns(predicted)
        per_run = (2 + bool(self.problem.loading)) * len(self.rows.runs)
        shared = np.zeros((len(self.rows), q))
        shared[:, 0] = linear[:, 0]
        tail = (2 + bool(self.problem.loading)) * runs + 1
        shared[:, tail:] = linear[:, 1 + per_run :]
        apart = linear[:, 1 : 1 + per_run] * self.fitter.widths[1 : 1 + per_run]
        return np.column_stack([own * (1.0 + fit.linear[0]), shared]), np.sum(apart**2, axis=1)

    def _instants(self, fit: Fit, predicted: np.ndarray) -> np.ndarray:
        """Return the variance by steps whose instants no fitted run tells."""
        return np.zeros_like(predicted)

    def _of_fit(self, fit: Fit, predicted: np.ndarray):
        jacobian, apart = self._jacobian(fit, predicted)
        n = len(fit.priors)
        middle = predicted + jacobian[:, n:] @ fit.linear
        variance = np.einsum("ij,jk,ik->i", jacobian, fit.covariance, jacobian) + apart
        return middle, variance + self._noise(fit, middle) ** 2

    def _noise(self, fit: Fit, middle: np.ndarray) -> np.ndarray:
        return fit.noise.common * self.fitter.noise.deviation(middle, fit.noise.share)

    def _beside(self, discrepancy: Discrepancy):
        """Return what each discrepancy of a hypothesis says of the rows."""
        fit = discrepancy.fit
        predicted = self.fitter.predict([fit.theta])[0]
        jacobian, apart = self._jacobian(fit, predicted)
        unused = discrepancy._signatures(self.fitter, predicted) * discrepancy.shares
        pulls = [p.pull(c)[1] for p, c in zip(fit.priors.values(), fit.coordinates, strict=True)]
        widths = np.concatenate([1.0 / np.sqrt(pulls), self.problem_widths])
        columns = np.column_stack([jacobian * widths, self._bounded(unused, 1.0)])
        centres = np.array([p.centre for p in fit.priors.values()])
        own = jacobian[:, : len(centres)]
        fastest = np.max(self.problem.fitted.fastest)
        growth = np.log(self.rows.fastest / fastest)[self.rows.run]
        missed = (self.missed(fit) * self.rows.size) ** 2
        found = []
        for member in discrepancy.members:
            c = columns.shape[1]
            change = columns @ member.mean[:c] - own @ (fit.coordinates - centres)
            middle = predicted + self._bounded(change[:, None], _FAR)[:, 0]
            spread = np.sum((columns @ member.root[:c]) ** 2, axis=1) * member.noise**2
            curve = member.noise * member.curve * self.rows.size * np.exp(member.growth * growth)
            variance = np.maximum(spread + apart + curve**2, missed)
            variance = self._bounded(np.sqrt(variance)[:, None], _FAR)[:, 0] ** 2
            noise = member.noise * self.fitter.noise.deviation(middle, fit.noise.share)
            found.append((member.log_weight, middle, variance + noise**2))
        return found

    def _bounded(self, columns: Float[np.ndarray, "rows k"], most: float) -> np.ndarray:
        """Return columns that change no run by more than so much of its size.

        To first order alone what is far from the fitted runs would grow without bound.
        """
        out = columns.copy()
        for i in range(len(self.rows.runs)):
            at = self.rows.run == i
            size = np.sqrt(np.mean((columns[at] / self.rows.size[at, None]) ** 2, axis=0))
            out[at] *= most / np.maximum(size, most)
        return out

    @property
    def problem_widths(self) -> np.ndarray:
        """Prior deviations of what is linear in the fitted runs."""
        return self.posterior.search.fitter.widths

    def missed(self, fit: Fit) -> Float[np.ndarray, " rows"]:
        """Return by how much, relative, each run may be missed as runs left out in turn are."""
        if "missed" not in fit.memory:
            fit.memory["missed"] = left_out(self.problem, fit)
        missed, fastest = fit.memory["missed"], self.problem.fitted.fastest
        size = [
            np.sqrt(np.mean((missed * np.maximum(fast / fastest, 1.0)) ** 2))
            for fast in self.rows.fastest
        ]
        return np.array(size)[self.rows.run]


def left_out(problem: Problem, fit: Fit) -> Float[np.ndarray, " runs"]:
    """Return by how much of its size each fitted run is missed when it is left out."""
    rows, found = problem.fitted, []
    for i in range(len(rows.runs)):
        fitter = Fitter(problem, rows, without=i)
        start = fitter.start(fit.names, fit.theta, fit.linear)
        # when a rate steps is read off its own record, and is no prediction
        own = [step.place for step in rows.runs[i].rate_steps if step.place is not None]
        held = {problem.model.instants.start + place for place in own}
        start.priors = {at: prior for at, prior in start.priors.items() if at not in held}
        part = fitter.fit([start], _LEFT_OUT_ROUNDS, derivatives=False)[0]
        at = rows.run == i
        off = (rows.recorded - part.predicted)[at] / rows.size[at]
        noise = fit.noise.sizes[i] ** 2
        size = float(np.sqrt(max(float(np.mean(off**2)) - noise, 0.0)))
        found.append(min(size, 3.0) if np.isfinite(size) else 3.0)
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
