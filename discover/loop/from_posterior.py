"""A posterior as the result of a closed loop: everything that is reported, in one object."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, get_args

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.special import logsumexp

from discover.effects import AbstractEffect
from discover.forward.by_mode import DEGREE, constants_of_modes
from discover.inference.by_mode.constants import ConstantByMode, ModeConstant, StageParameter
from discover.inference.engine import Explanation as Told
from discover.inference.engine import Posterior
from discover.inference.engine.fits import Fit, Fitter
from discover.inference.engine.posterior import quantiles
from discover.inference.engine.problem import NUISANCES
from discover.inference.engine.rows import Rows
from discover.inference.engine.search import Search
from discover.inference.step_instants import instants_found
from discover.loop.final_model import (
    Bounds,
    augmented_fluid,
    declared_effects,
    declared_law,
    declared_parameters,
    states_of,
)
from discover.loop.loop_result import LoopResult
from discover.loop.parts import (
    CandidateScore,
    ErrorPair,
    Explanation,
    Explanations,
    LawFit,
    Stage,
    Verdict,
)
from discover.loop.run_record import RunRecord, errors_of, record_runs
from discover.loop.runs import why_untested
from discover.statistics.noise.whiteness import SIGNIFICANCE, noise_probability
from discover.words import percent_of

_NEGLIGIBLE = 1e-4
_DRAWS = 2000
_FEWEST_TOLD = 0.5
"""Half width of an interval over the prior's, from which on the runs tell nothing of a mode."""


def predicted(search: Search, fit: Fit, rows: Rows, held_out: bool) -> Float[np.ndarray, "runs n"]:
    """Return what a hypothesis predicts of runs, with what the bench does.

    Of runs that no fit saw, with what all runs share: zero, drift and loading are of each run.
    """
    problem, linear, fitter = search.problem, fit.linear, search.fitter
    found = problem.model.predictions([fit.theta], rows.batch)[0]
    if held_out:
        fitter = Fitter(problem, rows)
        each = 2 + bool(problem.loading)
        nothing, shared = np.zeros(each * len(rows.runs)), 1 + each * len(problem.fitted.runs)
        linear = np.concatenate([linear[:1], nothing, linear[shared:]])
    flat = rows.flat(found[None])[0]
    found[rows.seen] = flat + fitter.linear_columns(flat) @ linear
    return found


@dataclass(frozen=True)
class Ended:
    """A posterior, and what is reported of it.

    Attributes
    ----------
    posterior
        What the runs say.
    without_fluid
        Whether a record without any fluid is as likely.
    order
        Names of the runs of the data set, in its order.
    most
        Explanations that are listed.
    """

    posterior: Posterior
    without_fluid: bool
    order: Sequence[str]
    most: int

    @cached_property
    def verdict(self) -> Verdict:
        """What is to be believed."""
        if self.without_fluid:
            return "no_signal"
        found = self.posterior.verdict
        known = {one: one for one in get_args(Verdict)}
        return known[found]

    @cached_property
    def fit(self) -> Fit:
        """The likeliest hypothesis, fitted to the fitted runs."""
        told = self.posterior.explanations
        return self._fitted(told[0].members[0] if told and not self.without_fluid else ())

    @cached_property
    def path(self) -> list[Fit]:
        """The way to it: of each size the likeliest part that holds the one before."""
        path, whole = [self._fitted(())], frozenset(self.fit.names)
        while (left := whole - set(path[-1].names)):  # fmt: skip
            larger = [self._fitted({*path[-1].names, name}) for name in sorted(left)]
            path.append(max(larger, key=lambda fit: (fit.log_evidence, fit.log_likelihood)))
        return path

    def _fitted(self, names) -> Fit:
        """Return a hypothesis fitted to the fitted runs, from the likeliest with more effects."""
        search, key = self.posterior.search, frozenset(names)
        if key not in search.found:
            holding = [fit for fit in search.found.values() if set(fit.names) > key]
            near = max(holding, key=search.rank) if holding else search.found[frozenset()]
            problem = self.posterior.problem
            theta = problem.without(near.theta, *(set(near.names) - key))
            search.add([search.fitter.start(tuple(key), theta, near.linear)])
        return search.found[key]

    # predictions ------------------------------------------------------------------------------

    @cached_property
    def _own_instants(self) -> Float[np.ndarray, " p"] | None:
        """When rates step in the runs held out, by these themselves."""
        if self.posterior.problem.predicted is None:
            return None
        whole, *_ = self.posterior.memory["whole"]
        found = whole.found.get(frozenset(self.fit.names))
        return None if found is None else found.theta

    def theta_ahead(self, fit: Fit) -> Float[np.ndarray, " p"]:
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
        theta = self.theta_ahead(fit) if held_out else fit.theta
        return predicted(self.posterior.search, replace(fit, theta=theta), rows, held_out)

    def declared_predicted(self, rows: Rows) -> Float[np.ndarray, "runs n"]:
        """Return what the declared model predicts, its constants as fitted and the bench ideal."""
        problem, theta = self.posterior.problem, self.posterior.problem.zero.copy()
        own = [*problem.model.free_positions, *self._varying]
        theta[own] = self.path[0].theta[own]
        with np.errstate(all="ignore"):
            return problem.model.predictions([theta], rows.batch)[0]

    @property
    def _varying(self) -> list[int]:
        model = self.posterior.problem.model
        return [at for name in model.declared.by_mode_slices for at in model.varying(name)]

    @cached_property
    def records(self) -> list[RunRecord]:
        """All runs with the predictions of every stage, bands, and those of each explanation."""
        problem, found = self.posterior.problem, []
        fits = [self._fitted(one.members[0]) for one in self._listed]
        bands = self.posterior.bands() or []
        for rows, held_out in ((problem.fitted, False), (problem.predicted, True)):
            if rows is None:
                continue
            stages = [self.predicted(fit, rows, held_out) for fit in self.path[1:]]
            models = np.stack([self.declared_predicted(rows), *stages])
            records = record_runs(rows.runs, models, held_out, self.order)
            each = [self.predicted(fit, rows, held_out) for fit in fits]
            for i, record in enumerate(records):
                n = len(record.time)
                if held_out:
                    band = np.stack([bands[i].low, bands[i].high]) if bands else None
                else:
                    band = self._fitted_bands[:, rows.run == i]
                own = np.stack([one[i, :n] for one in each]) if each else None
                found.append(replace(record, band=band, by_explanation=own))
        return found

    @cached_property
    def _fitted_bands(self) -> Float[np.ndarray, "2 rows"]:
        """Where 95 % of repeated measurements of the fitted runs should lie."""
        fitter = self.posterior.search.fitter
        weights, middles, variances = [], [], []
        for fit, weight in self.posterior.fits or ((self.fit, 1.0),):
            record = fitter.record(fit)
            assert fit.jacobian is not None
            assert fit.covariance is not None
            noise = fit.noise.sizes[fitter.rows.run] * fitter.noise.deviation(
                record, fit.noise.share
            )
            spread = np.einsum("ij,jk,ik->i", fit.jacobian, fit.covariance, fit.jacobian)
            weights.append(weight)
            middles.append(record)
            variances.append(spread + noise**2)
        ends = quantiles(
            np.array(weights), np.array(middles), np.array(variances), (0.025, 0.975)
        )  # fmt: skip
        return np.stack(ends)

    # explanations -----------------------------------------------------------------------------

    @cached_property
    def _listed(self) -> tuple[Told, ...]:
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
            fit = self._fitted(first)
            parameters = {name: self._values(fit, effects[name]) for name in fit.names}
            # more effects that change nothing are no other explanation
            twins = tuple(other for other in others if not set(other) > set(first))
            found.append(Explanation(first, one.probability, pair, parameters, twins))
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

    def _shares(self, one: Told) -> Float[np.ndarray, " members"]:
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

    # constants --------------------------------------------------------------------------------

    @cached_property
    def bounds(self) -> Bounds:
        """95 % intervals of all that is free in the likeliest hypothesis, by position."""
        found = {}
        for at in self.fit.free:
            ends, value = self.posterior.interval(at), float(self.fit.theta[at])
            low, high = (value, value) if ends is None else ends
            found[at] = min(low, value), max(high, value)
        return found

    @cached_property
    def theta(self) -> Float[np.ndarray, " p"]:
        """Constants of the final fluid: those of the likeliest hypothesis, the bench ideal."""
        theta = self.fit.theta.copy()
        if 1 not in self.posterior.problem.declared.free_positions:
            theta[1] = 0.0  # the clock of the bench
        return theta

    @cached_property
    def by_mode(self) -> dict[str, ConstantByMode]:
        """Constants that may differ from mode to mode, by name."""
        declared = self.posterior.problem.declared
        free = {p.name for p in declared.free_parameters} | {e.name for e in declared.effects}
        there = [name for name in declared.by_mode if name in free or name in self.fit.names]
        return {name: self._by_mode(name) for name in there}

    def _by_mode(self, name: str) -> ConstantByMode:
        fit, model = self.fit, self.posterior.problem.model
        constant, at = model.constant(name)
        places = model.mode_places(fit.theta)
        every = [at, *model.varying(name)]
        lot = np.random.default_rng(0).standard_normal((_DRAWS, len(every)))
        chosen = [fit.free.index(one) for one in every]
        assert fit.covariance is not None
        root = np.linalg.cholesky(fit.covariance[np.ix_(chosen, chosen)])
        drawn = fit.coordinates[chosen] + lot @ root.T
        first = fit.priors[at]
        mean = np.array([first.to_value(np.clip(one, *first.ends)) for one in drawn[:, 0]])

        def of_modes(mean, varying):
            found = constants_of_modes(
                jnp.asarray(mean)[:, None], constant.low, constant.high,
                jnp.asarray(varying[:, :DEGREE]), jnp.asarray(varying[:, DEGREE:]),
                jnp.asarray(places),
            )  # fmt: skip
            return np.asarray(found)

        spread = of_modes(mean, drawn[:, 1:])
        low, high = np.quantile(spread, (0.025, 0.975), axis=0)
        values = of_modes(fit.theta[[at]], fit.theta[every[1:]][None])[0]
        width = constant.high - constant.low
        told = high - low < (_FEWEST_TOLD * width if np.isfinite(width) else 4.0 * np.abs(values))
        times = model.mode_times(fit.theta)
        modes = tuple(
            ModeConstant(float(t), float(v), (float(a), float(b)) if k else None, not k)
            for t, v, a, b, k in zip(times, values, low, high, told, strict=True)
        )
        ends = self.bounds[at]
        mean_time = float(times[0] / 10.0 ** places[0])
        return ConstantByMode(float(fit.theta[at]), ends, "", mean_time, DEGREE, (), modes)

    def stages(self) -> tuple[Stage, ...]:
        """Return the effects of the likeliest hypothesis, in order."""
        search, found = self.posterior.search, []
        for i, (before, after) in enumerate(zip(self.path[:-1], self.path[1:], strict=True), 1):
            (name,) = set(after.names) - set(before.names)
            effect, model = self.posterior.problem.effects[name], self.posterior.problem.model
            at = dict(zip((p.name for p in effect.parameters), model.positions(name), strict=True))
            parameters = {
                p.name: StageParameter(
                    float(self.fit.theta[at[p.name]]), self.bounds[at[p.name]], p.unit
                )
                for p in effect.parameters
            }
            left_open = tuple(
                key
                for key, one in parameters.items()
                if one.is_open_up_to(float(model.high[at[key]]))
            )
            if name in self.by_mode:
                parameters[effect.parameters[0].name] = self.by_mode[name]
            gained = 2.0 * (search.rank(after) - search.rank(before))
            found.append(
                Stage(
                    name, effect.kind, parameters, self._aliases(name), errors_of(self.records, i),
                    float(gained), effect.equation, effect.source, effect.check,
                    left_open=left_open,
                )
            )  # fmt: skip
        return tuple(found)

    def _aliases(self, name: str) -> tuple[str, ...]:
        """Return the effects that take the place of one in twins of the likeliest hypothesis."""
        told = self.posterior.explanations
        own, found = set(self.fit.names), []
        for member in told[0].members[1:] if told else ():
            instead = set(member) - own
            if own - set(member) == {name} and len(instead) == 1:
                found += instead
        return tuple(found)

    def rankings(self) -> tuple[tuple[CandidateScore, ...], ...]:
        """Return the candidates beside each part of the likeliest hypothesis, the best first."""
        search, fitter, found = self.posterior.search, self.posterior.search.fitter, []
        effects = self.posterior.problem.effects
        for fit in self.path:
            scores = []
            for start in search.scored(fit):
                (name,) = set(start.names) - set(fit.names)
                share, _ = start.memory["scored"]
                evidence = error = None
                refitted = search.found.get(frozenset(start.names))
                if refitted is not None and np.isfinite(refitted.log_evidence):
                    evidence = float(2.0 * (search.rank(refitted) - search.rank(fit)))
                    off = (fitter.record(refitted) - fitter.rows.recorded) / fitter.rows.size
                    error = float(np.mean(fitter.rows.rms_by_run(off)))
                scores.append(CandidateScore(name, effects[name].kind, share, evidence, error))
            found.append(tuple(scores))
        return tuple(found)

    # what is left -----------------------------------------------------------------------------

    def remaining(self, spikes: Mapping[str, Sequence[float]], of_rates: str) -> dict[str, Any]:
        """Return what is left, as the contract names it."""
        problem, fit = self.posterior.problem, self.fit
        rows = problem.fitted
        fitter = self.posterior.search.fitter
        left = np.zeros(rows.batch.recorded.shape)
        left[rows.seen] = (fitter.record(fit) - rows.recorded) / rows.size
        probability = noise_probability(left, rows.seen.astype(float), _padded(rows))
        worst = max(self.records, key=lambda record: float(record.errors[-1]))
        bounds = self.bounds
        held = () if problem.predicted is None else problem.predicted.runs
        at = problem.model.instants
        instants = {i: bounds.get(i, (0.0, 1.0)) for i in range(at.start, at.stop)}
        structured = self.verdict == "unexplained"
        said = f"{of_rates}. " * bool(of_rates)
        return {
            "structured": structured,
            "error": errors_of(self.records, -1).fit,
            "noise_floor": self.noise,
            "outliers": sum(map(len, spikes.values())),
            "outlier_times_s": spikes,
            "probability": probability,
            "without_fluid": self.without_fluid,
            "untested": why_untested(self._constants, rows.runs, held),
            "linear_error": problem.declared.linear_error,
            "autocorrelation": fit.noise.correlation,
            "worst_run": worst.name,
            "worst_run_error": float(worst.errors[-1]),
            "bench": self._bench(),
            "description": said + self._in_words(probability),
            "step_instants": {}
            if not problem.declared.step_instants
            else instants_found(problem.model, self.theta_ahead(fit), instants, rows.runs, held),
            **self._loadings(),
        }

    @property
    def _constants(self) -> int:
        """How many constants were fitted, those of the declared model counted as one."""
        model = self.posterior.problem.model
        added = sum(len(model.positions(name)) for name in self.fit.names)
        return max(added, int(bool(model.declared.free_constants)))

    @property
    def noise(self) -> float:
        """Relative noise, mean over the fitted runs."""
        known = self.posterior.problem.noise
        return float(np.mean(self.fit.noise.sizes)) if known is None else known

    def _in_words(self, probability: float | None) -> str:
        none = percent_of(self.posterior.unexplained)
        if self.without_fluid:
            return "Records of noise and the bench alone, without any fluid, are as likely."
        text = f"That something is there which has no name has a probability of {none}."
        if self.verdict == "unexplained":
            text = f"Some effect is still missing, or has another form. {text}"
        if probability is not None and probability < SIGNIFICANCE:
            text += f" Were it noise, a residual like this has a probability of {probability:.2g}."
        return text

    def _bench(self) -> dict[str, float]:
        """Return by how much a sound bench is off here, as fitted along: its nuisances."""
        problem, fit = self.posterior.problem, self.fit
        found = {"stress_gain": float(fit.linear[0])}
        if 1 not in problem.declared.free_positions:
            found["clock"] = float(fit.theta[1])
        for nuisance in NUISANCES:
            at = problem.model.positions(nuisance.effect)[0]
            if at in fit.priors and nuisance.effect not in fit.names:
                found[nuisance.effect] = float(fit.theta[at])
        return found

    def _loadings(self) -> dict[str, Any]:
        """Return the factors of loadings by run, where each run is a loading of its own."""
        problem, fit = self.posterior.problem, self.fit
        if not problem.loading:
            return {}
        runs, first = problem.fitted.runs, 1 + 2 * len(problem.fitted.runs)
        assert fit.covariance is not None
        spread = np.sqrt(np.diag(fit.covariance))[len(fit.priors) :]
        found = {}
        for i, run in enumerate(runs):
            factor, half = 1.0 + float(fit.linear[first + i]), 1.96 * float(spread[first + i])
            found[run.name] = {
                "factor": factor, "ci95": [factor - half, factor + half], "held_out": False,
            }  # fmt: skip
        return {"loading_deviation": problem.loading, "loading": found}


def result_of(
    ended: Ended,
    laws: tuple[LawFit, ...],
    spikes: Mapping[str, Sequence[float]],
    of_rates: str,
    seconds: float,
) -> LoopResult:
    """Return the result of a loop.

    Parameters
    ----------
    ended
        The posterior that it ended with.
    laws
        Those that the declared one was chosen from.
    spikes
        Times of samples set aside as outliers, by run.
    of_rates
        That rates were read with noise which the fluid did not feel, in words; empty where not.
    seconds
        Time taken.
    """
    problem, theta = ended.posterior.problem, ended.theta
    declared, model, by_mode = problem.declared, problem.model, ended.by_mode
    present = [*ended.fit.names, *(known.name for known in declared.effects)]
    fluid = augmented_fluid(model, theta, present)
    states = states_of(model, theta, present)
    whole = bool(by_mode) or states != ()
    own = declared_parameters(declared, theta, ended.bounds)
    of_law = {name: one for name, one in by_mode.items() if name in own}
    # only what is fitted of a known effect has an interval
    free = {at: ends for at, ends in ended.bounds.items() if at in model.free_positions}
    stages = ended.stages()
    return LoopResult(
        verdict=ended.verdict,
        error_before=errors_of(ended.records, 0),
        error_after=errors_of(ended.records, -1),
        noise_floor=ended.noise,
        stages=stages,
        remaining=ended.remaining(spikes, of_rates),
        rankings=ended.rankings(),
        records=tuple(ended.records),
        declared_parameters=own | of_law,
        declared_effects=declared_effects(model, theta, free, by_mode),
        declared_law=declared_law(declared, theta, of_law),
        explanations=ended.explanations,
        laws=laws,
        fluid=None if whole else fluid,
        fluid_at_mean=fluid if whole else None,
        states=states or (),
        seconds=seconds,
    )


def _largest_first(found: dict[str, float]) -> dict[str, float]:
    return dict(sorted(found.items(), key=lambda pair: -pair[1]))


def _padded(rows: Rows) -> Float[np.ndarray, "runs n"]:
    out = np.zeros(rows.batch.recorded.shape)
    out[rows.seen] = rows.recorded
    return out
