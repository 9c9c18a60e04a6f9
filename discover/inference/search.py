"""Search among hypotheses: sets of effects, from the simplest on, with exchange and steps back."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float

from discover.inference.fits import Fit, Fitter
from discover.inference.priors import Priors
from discover.inference.problem import Problem

_BEAM = 3
_REFITTED = 8
"""Candidates of each set in the beam that are refitted, of all that are scored."""

_EXCHANGED = 6
_BEST = 4
_FALLEN = 15.0
"""Log likelihood within which a set with an effect at zero shows that another set is as likely."""

_ROUNDS = 3
_HEADROOM = 1.0
"""Log evidence by which a larger set may fall behind for the search to go on."""

_PROBES = (1e-3, 1.0)
"""Of its prior width: amplitudes at which the signature of an effect is taken. What a filter or a
structure does is not in proportion to its amplitude."""

Key = frozenset[str]


class Search:
    """Hypotheses that were fitted, by the set of their effects.

    `fitter`: what fits them. `most`: effects in one set. `say`: called with a line of text now and
    then. `known`: hypotheses that another search fitted, which are not fitted again.
    """

    def __init__(
        self,
        fitter: Fitter,
        most: int = 3,
        say: Callable[[str], None] | None = None,
        known: Mapping[Key, Fit] | None = None,
    ):
        self.fitter, self.problem, self.most = fitter, fitter.problem, most
        self.say, self._known = say or (lambda line: None), known or {}
        self.found: dict[Key, Fit] = {}
        self._taken_out: set[tuple[tuple[str, ...], tuple[str, ...]]] = set()

    def copied(self) -> "Search":
        """Return a search that goes on from here, while this one stays as it is."""
        other = copy(self)
        other.found, other._taken_out = {**self.found}, {*self._taken_out}
        return other

    def rank(self, fit: Fit) -> float:
        """Return the log of evidence times prior."""
        return fit.log_evidence + self.problem.log_prior(fit.names)

    def ranked(self) -> list[Fit]:
        """Return hypotheses that are possible, the likeliest first."""
        usable = (fit for fit in self.found.values() if np.isfinite(fit.log_evidence))
        return sorted(usable, key=self.rank, reverse=True)

    @property
    def _likeliest(self) -> str:
        return ", ".join(max(self.found.values(), key=self.rank).names) or "none"

    def add(self, starts: Iterable[Fit], wanted: int | None = None) -> list[Fit]:
        """Fit hypotheses side by side and keep them; of one set the likeliest.

        `wanted`: so many of the best are asked for; what cannot come near them is given up.
        """
        asked, before = [], {*self.found}
        for start in starts:
            key = frozenset(start.names)
            fit = self._known.get(key)
            # one that was given up is fitted where it is asked for once more
            if fit is None or (fit.root is None and key in before):
                asked.append(start)
            else:
                self.found.setdefault(key, fit)
        fits = self.fitter.fit(asked, wanted=wanted, known=self.found.values())
        for fit in fits:
            key = frozenset(fit.names)
            known = self.found.get(key)
            if known is None or self.rank(fit) > self.rank(known):
                self.found[key] = fit
        return fits

    def at_several_times(self, start: Fit) -> list[Fit]:
        """Return a hypothesis to be fitted, and the same from other relaxation times."""
        others = self.problem.other_times(start.names, start.theta)
        return [start, *(self.fitter.start(start.names, one, start.linear) for one in others)]

    def run(self) -> "Search":
        """Find hypotheses from the empty set on."""
        self.add(self.at_several_times(self.fitter.start((), self.problem.zero)))
        level = [self.found[frozenset()]]
        for depth in range(self.most):
            usable = [fit for fit in level if np.isfinite(fit.log_posterior)]
            starts: list[Fit] = []
            new: dict[Key, None] = {}  # in their order: that of a set changes from run to run
            for parent in usable:
                # far from the minimum a score says little, of effects and of their inner constants
                top = _REFITTED if depth else None
                some = self.scored(parent, every_start=not depth)[:top]
                for start in some:
                    key = frozenset(start.names)
                    if key not in self.found:  # of two parents it may end in two places
                        new[key] = None
                        starts += self.at_several_times(start)
            if not starts:
                break
            best = max(map(self.rank, self.found.values()))
            fitted = {fit.names for fit in self.add(starts, wanted=_BEAM)}
            self.say(f"sets of {depth + 1}: {len(fitted)} fitted, likeliest: {self._likeliest}")
            level = sorted((self.found[key] for key in new), key=self.rank, reverse=True)[:_BEAM]
            level = [fit for fit in level if np.isfinite(self.rank(fit))]
            if not level or (depth and self.rank(level[0]) < best - _HEADROOM):
                break
        self.backwards()
        self.exchange()
        self.backwards()
        own = len(self.found.keys() - self._known.keys())
        self.say(f"exchanged: {own} sets, likeliest: {self._likeliest}")
        return self

    def scored(self, fit: Fit, every_start: bool = False) -> list[Fit]:
        """Return hypotheses with one effect more, ready to be fitted, the likeliest first.

        With `every_start` each from all starts of its inner constants, and else from the likeliest.

        Each is scored from one linearisation at amplitude zero, inner constants at several starts:
        the gain of log likelihood with noise sizes free, less the Laplace price of its prior. Both
        the share of the squared residual that this is and the score stand in `memory["scored"]`.
        """
        problem, fitter = self.problem, self.fitter
        if fit.root is None or fit.jacobian is None:
            return []
        asked = [
            (effect.name, inner, probe)
            for effect in problem.candidates
            if effect.name not in fit.names
            for inner in problem.starts(effect.name)
            for probe in _PROBES
        ]
        if not asked:
            return []
        positions = {name: problem.model.positions(name)[0] for name, *_ in asked}
        priors = {name: problem.amplitude(name) for name in positions}
        thetas, steps = [], []
        for name, inner, probe in asked:
            theta, at, prior = fit.theta.copy(), positions[name], priors[name]
            theta[[*inner]] = [*inner.values()]
            # what is there already is a nuisance that may be at fault
            theta[at] = theta[at] if at in fit.priors else 0.0
            step = probe * prior.width
            steps.append(-step if theta[at] + step > prior.high else step)
            thetas.append(theta)
        moved = np.array(thetas)
        moved[np.arange(len(asked)), [positions[name] for name, *_ in asked]] += steps
        with np.errstate(over="ignore", invalid="ignore"):  # an effect that runs away
            columns = (fitter.predict(moved) - fit.predicted).T / np.array(steps)
        usable = np.all(np.isfinite(columns), axis=0)
        columns = np.where(usable, columns, 0.0)
        record = fitter.record(fit)
        both = np.column_stack([fit.jacobian, fitter.rows.recorded - record, columns])
        white = fitter.noise.whitened(both, record, fit.noise)
        n = fit.jacobian.shape[1]
        known, left, new = white[:, :n], white[:, n], white[:, n + 1 :]
        shared = (known @ fit.root).T @ new
        slope = left @ new
        curvature = np.sum(new**2, axis=0) - np.sum(shared**2, axis=0)
        total, count = float(left @ left), len(left)
        best: dict[Any, tuple[float, Fit]] = {}
        for i, ((name, inner, _), theta) in enumerate(zip(asked, thetas, strict=True)):
            at, prior = positions[name], priors[name]
            stiff = max(float(curvature[i]), 0.0) + 1.0 / prior.width**2
            middle, variance = prior.centre, prior.width**2
            size = float(np.clip((slope[i] + middle / variance) / stiff, prior.low, prior.high))
            if not usable[i] or (prior.low == 0.0 and size <= 0.0 and not problem.fits_times):
                continue
            size = size or steps[i]  # at other times it may be there
            # within the range, and never so far that the first order means nothing
            by_prior = (size - middle) ** 2 / variance
            gain = slope[i] * size - 0.5 * max(float(curvature[i]), 0.0) * size**2 - 0.5 * by_prior
            gain = -0.5 * count * np.log(max(1.0 - 2.0 * gain / max(total, 1e-300), 1e-4))
            score = gain - 0.5 * np.log(stiff * prior.width**2) + np.log(problem.odds(name))
            key = (name, *inner.items()) if every_start else name
            if key in best and best[key][0] >= score:
                continue
            theta[at] = np.clip(theta[at] + size, prior.low, prior.high)
            best[key] = score, fitter.start((*fit.names, name), theta, fit.linear)
            share = max(-np.expm1(-2.0 * gain / count), 0.0)
            best[key][1].memory["scored"] = float(share), float(score)
        return [one for _, one in sorted(best.values(), key=lambda pair: -pair[0])]

    def improves_with_another_effect(self, fit: Fit) -> bool:
        """Try each effect beside the law of a fit, from its constants; return whether one helps.

        `fit`: at which a law is as it would be where something else is explained; of this search or
        with more that is linear in the records.
        """
        best, linear = max(map(self.rank, self.ranked())), fit.linear[: len(self.fitter.errors)]
        starts = [self.fitter.start(fit.names, fit.theta, linear)]
        (here,) = self.fitter.fit(starts, rounds=0)
        self.add(self.scored(here), wanted=1)
        return max(map(self.rank, self.ranked())) > best

    def exchange(self) -> None:
        """Put another effect in the place of each of the best set, until nothing is better."""
        seen: set[Key] = set()
        while self.ranked():
            best = self.ranked()[0]
            if not best.names or frozenset(best.names) in seen:
                return
            seen.add(frozenset(best.names))
            starts: dict[Key, Fit] = {}
            smaller = [self.found.get(frozenset(best.names) - {name}) for name in best.names]
            self.add(
                self.fitter.start(f.names, f.theta, f.linear)
                for f in smaller
                if f and f.root is None
            )
            for name in best.names:
                rest = self.found.get(frozenset(best.names) - {name})
                if rest is None or not np.isfinite(rest.log_posterior):
                    continue
                for start in self.scored(rest)[:_EXCHANGED]:
                    if frozenset(start.names) not in self.found:
                        starts.setdefault(frozenset(start.names), start)
            timed = [one for start in starts.values() for one in self.at_several_times(start)]
            self.add(timed, wanted=_BEAM)

    def backwards(self) -> "Search":
        """Take effects out of the best sets again, and those that a fit put to zero."""
        for _ in range(_ROUNDS):
            alive = self.ranked()
            top = alive[0].log_likelihood if alive else -np.inf
            fallen = [
                fit
                for fit in self.found.values()
                if fit.vanished and fit.log_likelihood > top - _FALLEN
            ]
            fallen = sorted(fallen, key=lambda fit: -fit.log_likelihood)[:_BEST]
            starts = []
            for fit in [*alive[:_BEST], *fallen]:
                for name in fit.vanished or fit.names:
                    # also one that was fitted before: it may have ended beside its best constants
                    names = tuple(other for other in fit.names if other != name)
                    way = fit.names, names
                    if way in self._taken_out:
                        continue
                    self._taken_out.add(way)
                    theta = self.problem.without(fit.theta, name)
                    starts.append(self.fitter.start(names, theta, fit.linear))
            if not starts:
                break
            self.add(starts)
        return self


def refitted(fits: Sequence[Fit], fitter: Fitter) -> Search:
    """Return hypotheses fitted to other rows, from the constants that they have."""
    search = Search(fitter)
    search.add([fitter.start(fit.names, fit.theta) for fit in fits])
    return search


def without_by_mode(search: Search, fitter: Fitter) -> dict[Key, Fit]:
    """Return what a search found that has no constant by mode, for another fitter of its rows.

    The problems differ in which constants are by mode.
    """
    old, new = search.problem, fitter.problem
    differ, first = {*old.declared.by_mode, *new.declared.by_mode}, old.declared.size
    if differ - {effect.name for effect in old.candidates}:
        return {}  # every hypothesis has one
    shift, found = new.declared.size - first, {}
    for key, fit in search.found.items():
        if key.isdisjoint(differ):
            theta = with_one_constant(fit, old, new)
            priors = {at if at < first else at + shift: own for at, own in fit.priors.items()}
            found[key] = replace(fit, theta=theta, priors=Priors(priors), memory={**fit.memory})
    return found


def with_one_constant(fit: Fit, old: Problem, new: Problem) -> Float[np.ndarray, " p"]:
    """Return the constants of a fit in a problem with others by mode, each one for all modes."""
    theta, of_law = new.zero.copy(), 2 + len(old.declared.free_parameters)
    theta[:of_law] = fit.theta[:of_law]
    theta[new.declared.size :] = fit.theta[old.declared.size :]
    return theta
