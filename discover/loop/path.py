"""The way to the likeliest hypothesis: predictions of every run on it, bands, explanations."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float
from scipy.special import logsumexp

from discover.dataset import Run
from discover.effects import AbstractEffect
from discover.inference import Indistinguishable, Posterior
from discover.inference.fits import Fit, Fitter
from discover.inference.free_form import FreeForm
from discover.inference.rows import Rows
from discover.inference.search import Search
from discover.loop.parts import ErrorPair, Explanation, Explanations, Verdict
from discover.loop.runs import RunRecord, record_runs

_NEGLIGIBLE = 1e-4  # Probability below which an explanation is not listed


def predicted(fitter: Fitter, fit: Fit, rows: Rows) -> Float[np.ndarray, "runs n"]:
    """Return what a hypothesis predicts of runs, with what the bench does.

    Of runs that no fit saw, with what all runs share: zero, drift and loading are of each run.
    """
    errors, moduli = fitter.errors_of(rows), fitter.moduli_of(fit.linear)[None]
    with np.errstate(over="ignore", invalid="ignore"):  # of runs held out it may diverge
        found = fitter.problem.model.predictions([fit.theta], rows.batch, moduli)[0]
        linear, nothing = errors.like(fitter.errors, fit.linear), np.zeros((len(rows), 0))
        found[rows.seen] = errors.recorded(rows.flat(found[None]), linear[None], nothing)[0]
    return found


def records_of(search: Search, fit: Fit) -> list[RunRecord]:
    """Return the runs of a problem, fitted and held out, with what a hypothesis predicts."""
    problem, found = search.problem, []
    for rows, held_out in ((problem.fitted, False), (problem.predicted, True)):
        if rows is not None:
            own = predicted(search.fitter, fit, rows)[None]
            found += record_runs(rows.runs, own, held_out)
    return found


@dataclass(frozen=True)
class Path:
    """A posterior, the likeliest hypothesis of it, and the way there.

    `posterior`: what the runs say. `without_fluid`: whether a record without any fluid is as
    likely. `most`: explanations that are listed. `curves`: functions of one variable that are
    likelier than all that has a name.
    """

    posterior: Posterior
    without_fluid: bool
    most: int
    curves: Sequence[FreeForm] = ()

    @cached_property
    def verdict(self) -> Verdict:
        """What is to be believed."""
        return "no_signal" if self.without_fluid else self.posterior.verdict

    @cached_property
    def fit(self) -> Fit:
        """The likeliest hypothesis, fitted to the fitted runs."""
        told, best = self.posterior.explanations, self.posterior.predictive_mixture
        if self.without_fluid or not told:
            return self.fitted(())
        # where none of them is all there is, the one that predicts best
        if best and self.posterior.has_function(best[0][0]):
            return best[0][0]
        names = best[0][0].names if best and self.verdict == "unexplained" else told[0].members[0]
        found = self.fitted(names)
        while idle := self._idle(found):
            found = self.fitted(set(found.names) - set(idle))
        return found

    def _idle(self, fit: Fit) -> tuple[str, ...]:
        """Return effects of a hypothesis for which the fitted runs do not ask.

        They may have been asked for by the runs held out, or by those left out in turn, to which
        hypotheses are alike that differ by an effect of no size.
        """
        if fit.vanished or self.verdict != "unexplained":
            return fit.vanished
        gained = {}
        for name in fit.names:
            without = self.fitted(set(fit.names) - {name})
            # each constant fits noise by one   [Akaike 1974, IEEE Trans. Autom. Control 19, 716]
            constants = len(self.posterior.problem.effects[name].parameters)
            gained[name] = fit.log_likelihood - without.log_likelihood - constants
        # one at a time: of two that do the same either is idle beside the other
        least = min(gained, key=gained.__getitem__, default="")
        return (least,) if least and gained[least] < 0.0 else ()

    @cached_property
    def path(self) -> list[Fit]:
        """The way to it: of each size the likeliest part that holds the one before."""
        path, whole = [self.fitted(())], frozenset(self.fit.names)
        while (left := whole - set(path[-1].names)):  # fmt: skip
            larger = [self.fitted({*path[-1].names, name}) for name in sorted(left)]
            path.append(max(larger, key=lambda fit: (fit.log_evidence, fit.log_likelihood)))
        return path

    def fitted(self, names) -> Fit:
        """Return a hypothesis fitted to the fitted runs, from the likeliest with more effects."""
        search, key = self.posterior.search, frozenset(names)
        if key not in search.found:
            holding = [fit for fit in search.found.values() if set(fit.names) > key]
            near = max(holding, key=search.rank) if holding else search.found[frozenset()]
            problem = self.posterior.problem
            theta = problem.without(near.theta, *(set(near.names) - key))
            search.add([search.fitter.start(tuple(sorted(key)), theta, near.linear)])
        return search.found[key]

    @cached_property
    def _own_instants(self) -> Float[np.ndarray, " p"] | None:
        """When rates step in the runs held out, by these themselves."""
        if self.posterior.problem.predicted is None:
            return None
        whole, *_ = self.posterior.memory["whole"]
        found = whole.found.get(frozenset(self.fit.names))
        return None if found is None else found.theta

    def held_out_theta(self, fit: Fit) -> Float[np.ndarray, " p"]:
        """Return the constants for runs that no fit saw, which tell their own instants of steps."""
        theta, own = fit.theta.copy(), self._own_instants
        if own is not None:
            used = {s.place for run in self.posterior.problem.fitted.runs for s in run.rate_steps}
            instants = self.posterior.problem.model.instants
            for place, at in enumerate(range(instants.start, instants.stop)):
                if place not in used:
                    theta[at] = own[at]
        return theta

    def predicted(self, fit: Fit, rows: Rows, held_out: bool) -> Float[np.ndarray, "runs n"]:
        """Return what a hypothesis predicts of runs, held out or fitted."""
        theta = self.held_out_theta(fit) if held_out else fit.theta
        fitter = self.posterior.fitter_of(fit)
        return predicted(fitter, replace(fit, theta=theta), rows)

    def records_of_unfitted(self, runs: Sequence[Run]) -> list[RunRecord]:
        """Return what else runs recorded with its prediction, which no fit has seen."""
        found = self.predicted(self.fit, Rows.of(runs), True) if runs else np.empty((0, 0))
        return record_runs(runs, found[None], True)

    @cached_property
    def declared_theta(self) -> Float[np.ndarray, " p"]:
        """Constants of the declared model as fitted to the runs alone, the bench ideal."""
        problem = self.posterior.problem
        theta, own = problem.zero.copy(), [*problem.model.free_positions, *self._varying]
        theta[own] = self.fitted(()).theta[own]
        return theta

    def declared_predicted(self, rows: Rows) -> Float[np.ndarray, "runs n"]:
        """Return what the declared model predicts."""
        with np.errstate(all="ignore"):
            return self.posterior.problem.model.predictions([self.declared_theta], rows.batch)[0]

    @property
    def _varying(self) -> list[int]:
        model = self.posterior.problem.model
        return [at for name in model.declared.by_mode_slices for at in model.varying(name)]

    @cached_property
    def records(self) -> list[RunRecord]:
        """All runs with the predictions of every stage, bands, and those of each explanation."""
        problem, found = self.posterior.problem, []
        fits = [self.fitted(one.members[0]) for one in self._listed]
        for rows, held_out in ((problem.fitted, False), (problem.predicted, True)):
            if rows is None:
                continue
            bands = self.posterior.bands(rows)
            steps = [*self.path[1:-1], self.fit] if self.fit.names else []
            stages = [self.predicted(fit, rows, held_out) for fit in steps]
            models = np.stack([self.declared_predicted(rows), *stages])
            records = record_runs(rows.runs, models, held_out)
            each = [self.predicted(fit, rows, held_out) for fit in fits]
            for i, record in enumerate(records):
                n = len(record.time)
                ends, own = bands[i], np.stack([one[i, :n] for one in each]) if each else None
                band = None if ends is None else np.stack([ends.low, ends.high])[..., 0]
                found.append(replace(record, band=band, by_explanation=own))
        return found

    @cached_property
    def _listed(self) -> tuple[Indistinguishable, ...]:
        first, *others = self.posterior.explanations[: self.most] or (None,)
        if first is None:
            return ()
        return (first, *(one for one in others if one.probability > _NEGLIGIBLE))

    @cached_property
    def explanations(self) -> Explanations:
        """The posterior over sets of effects, as the result holds it."""
        effects, found = self.posterior.problem.effects, []
        inclusion: dict[str, float] = {}
        kinds: dict[str, float] = {}
        for i, one in enumerate(self._listed):
            first, *others = one.members
            pair = ErrorPair(self._error(i, False) or 0.0, self._error(i, True))
            fit = self.fitted(first)
            parameters = {name: self._values(fit, effects[name]) for name in fit.names}
            found.append(Explanation(first, one.probability, pair, parameters, tuple(others)))
            for member, share in zip(one.members, self._shares(one), strict=True):
                for name in member:
                    inclusion[name] = inclusion.get(name, 0.0) + float(share)
                for kind in {effects[name].kind for name in member}:
                    kinds[kind] = kinds.get(kind, 0.0) + float(share)
        none = 1.0 - sum(one.probability for one in found)
        return Explanations(
            tuple(found),
            float(np.clip(none, 0.0, 1.0)),
            _largest_first(inclusion),
            _largest_first(kinds),
        )

    def _shares(self, one: Indistinguishable) -> Float[np.ndarray, " members"]:
        """Return the probability of each member of an explanation."""
        judged, *_ = self.posterior.memory["whole"]
        ranks = np.array([judged.rank(judged.found[frozenset(names)]) for names in one.members])
        return one.probability * np.exp(ranks - logsumexp(ranks))

    def _error(self, number: int, held_out: bool) -> float | None:
        errors = []
        for record in self.records:
            if record.held_out is held_out and record.by_explanation is not None:
                off = record.by_explanation[number] - record.measured
                errors.append(np.sqrt(np.mean(off**2) / (np.mean(record.measured**2) or 1.0)))
        return float(np.mean(errors)) if errors else None

    def _values(self, fit: Fit, effect: AbstractEffect) -> dict[str, float]:
        at = self.posterior.problem.model.positions(effect.name)
        return {p.name: float(fit.theta[i]) for p, i in zip(effect.parameters, at, strict=True)}


def _largest_first(found: dict[str, float]) -> dict[str, float]:
    return dict(sorted(found.items(), key=lambda pair: -pair[1]))
