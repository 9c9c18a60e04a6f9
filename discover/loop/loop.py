"""The closed loop: the posterior over what a declared model lacks, and what runs say of it."""

import time
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from discover.dataset import Dataset, Run
from discover.dataset.records.repeats import with_loadings
from discover.effects import AbstractEffect, ConstitutiveEffect
from discover.errors import InputError
from discover.forward import MODULUS, RELAXATION_TIME, DeclaredModel
from discover.forward.declared import may_differ_by_mode
from discover.inference.engine import Posterior, Problem, explain
from discover.inference.engine.discrepancy import Discrepancy
from discover.inference.engine.fits import Fitter
from discover.inference.engine.free_functions import FreeFunction, free_functions
from discover.inference.engine.inelastic import inelastic
from discover.inference.engine.search import Search
from discover.inference.scattered_rates import smoothed, unfelt_scatter
from discover.inference.step_instants import with_places
from discover.laws import LAWS
from discover.laws.registry import starting_values
from discover.linear_algebra_threads import in_one_thread
from discover.loop.candidates import admission, candidates_beside
from discover.loop.from_posterior import Ended, result_of
from discover.loop.loop_result import LoopResult
from discover.loop.parts import LawFit
from discover.loop.path import predicted
from discover.loop.preference import with_named_law_first
from discover.loop.run_record import errors_of, record_runs
from discover.loop.runs import MOST_SAMPLES, require_samples, split_runs
from discover.loop.simple import inelastic_result, simple_result
from discover.words import unknown_name

MOST_LISTED = 8
"""Explanations that are listed by default."""

_OFF = 1e-30
"""Factor on the moduli of a fluid that is switched off."""

_AT_END = 1e-3
"""Share of its range within which a constant stands at an end."""

_DIVERGES = "its stress diverges. Check its parameters, modes and units."

Say = Callable[[str], None]


@in_one_thread
def run_loop(
    dataset: Dataset,
    declared: DeclaredModel,
    fit: Sequence[str] | None = None,
    held_out: Sequence[str] = (),
    effects: Sequence[str | AbstractEffect] | str | None = None,
    max_effects: int = 3,
    strain: tuple[float, float] | None = None,
    noise: float | None = None,
    most_samples: int = MOST_SAMPLES,
    explanations: int = MOST_LISTED,
    laws: Sequence[str] = (),
    progress: Say | None = None,
    loading: float | None = None,
) -> LoopResult:
    """Find what a declared model lacks, add it, and test the result on held-out runs.

    Hypotheses are sets of effects beside the declared model, which is never exact: small instrument
    errors are fitted jointly. All are weighed by evidence and prior, unknown effects among them;
    see `discover.inference.engine`. Nothing is random.

    Parameters
    ----------
    declared
        The model to start from.
    fit
        Names of the runs to fit; by default all that are not held out.
    held_out
        Names of the held-out runs, which only test.
    effects
        Candidates, by name, by spelling of a library term, or as objects; ``"named"`` for every
        effect with a name that is no candidate on request alone; by default these and every library
        term up to one invariant.
    max_effects
        Largest number of effects added.
    strain
        Smallest and largest strain of the samples fitted and tested.
    noise
        Relative noise, where it is known; estimated along otherwise.
    most_samples
        Of a run with more samples at most so many are used, evenly chosen; of
        one with little noise fewer, but no fewer than 150.
    explanations
        How many sets of effects are listed, at most.
    laws
        Named laws to choose the declared one from, by the fitted runs alone, each with the effects
        likeliest beside it. By default it is as it was declared.
    progress
        Called with a line of text now and then.
    loading
        Relative standard deviation by which loadings of the sample differ, where each run is one of
        its own: its record is then a factor of its own times what the model predicts, with that
        deviation from one. By default there is no such factor.

    Raises
    ------
    InputError
        If runs, window or effects are not as they should be, or the model diverges in the fitted
        runs.
    """
    started = time.perf_counter()
    asked = _asked(
        dataset, declared, fit, held_out, effects, max_effects, strain, noise, most_samples,
        progress, loading,
    )  # fmt: skip
    task = asked.task
    if max_effects and (effects is None or effects == "named"):
        task.say("yield stress, viscous fluid or solid")
        simple = simple_result(
            asked.declared, task.fitted, task.held_out, asked.spikes, time.perf_counter() - started
        )
        if simple is not None:
            return simple
    found = asked.found(laws)
    viscous = inelastic(found.posterior) if max_effects else None
    if viscous is not None:
        spent = time.perf_counter() - started
        simple = inelastic_result(
            asked.declared, viscous, task.fitted, task.held_out, asked.spikes, spent
        )
        if simple is not None:
            return simple
    found = found.with_curves()
    task.say("bands, intervals and the next test")
    return found.result(explanations, time.perf_counter() - started)


@dataclass(frozen=True)
class Found:
    """What a search found in runs, before it is reported.

    Attributes
    ----------
    task
        What was searched.
    posterior
        Over the hypotheses that were fitted.
    tried
        The search with each law that the declared one was chosen from.
    order
        Names of the runs of the data set.
    spikes
        Times of samples set aside as outliers, by run.
    of_rates
        That rates were read with noise which the fluid did not feel; empty where not.
    curves
        Free functions of one variable that are likelier than all that has a name.
    """

    task: "Task"
    posterior: Posterior
    tried: Mapping[str, Search]
    order: Sequence[str]
    spikes: Mapping[str, Sequence[float]]
    of_rates: str
    curves: Sequence[FreeFunction] = ()

    def with_curves(self) -> "Found":
        """Return what was found with free functions of one variable among the hypotheses."""
        self.task.say("curves of one variable")
        curves = free_functions(self.posterior)
        if not curves:
            return self
        odds = float(np.logaddexp.reduce([curve.log_odds_in_all for curve in curves]))
        shown = [curve for curve in curves if curve.is_shown]
        return replace(self, posterior=self.posterior.with_something_else(odds), curves=shown)

    @cached_property
    def _reported(self) -> Posterior:
        return with_named_law_first(self.posterior)

    def ended(self, explanations: int = MOST_LISTED) -> Ended:
        """Return what is reported of the posterior, with so many explanations at most."""
        posterior = self._reported
        return Ended(posterior, without_fluid(posterior), self.order, explanations, self.curves)

    def result(self, explanations: int = MOST_LISTED, seconds: float = 0.0) -> LoopResult:
        """Return the result of a closed loop."""
        lines = self.task.lines(self.tried) if self.tried else ()
        return result_of(self.ended(explanations), lines, self.spikes, self.of_rates, seconds)


def search_runs(
    dataset: Dataset,
    declared: DeclaredModel,
    fit: Sequence[str] | None = None,
    held_out: Sequence[str] = (),
    effects: Sequence[str | AbstractEffect] | str | None = None,
    max_effects: int = 3,
    strain: tuple[float, float] | None = None,
    noise: float | None = None,
    most_samples: int = MOST_SAMPLES,
    laws: Sequence[str] = (),
    progress: Say | None = None,
    loading: float | None = None,
    computed: bool = False,
) -> Found:
    """Search among hypotheses on what a declared model lacks; parameters as in `run_loop`.

    Runs that were computed know no instrument, a sound one either.
    """
    return _asked(
        dataset, declared, fit, held_out, effects, max_effects, strain, noise, most_samples,
        progress, loading, computed,
    ).found(laws)  # fmt: skip


@dataclass(frozen=True)
class _Asked:
    """A task, and what is told of its runs."""

    task: "Task"
    declared: DeclaredModel
    order: Sequence[str]
    spikes: Mapping[str, Sequence[float]]
    of_rates: str

    def found(self, laws: Sequence[str]) -> Found:
        """Search, with the likeliest of some laws in place of the declared one."""
        declared, tried = self.task.choose(self.declared, laws)
        posterior = _by_mode(self.task, self.task.explained(declared))
        return Found(self.task, posterior, tried, self.order, self.spikes, self.of_rates)


def _asked(
    dataset: Dataset,
    declared: DeclaredModel,
    fit: Sequence[str] | None,
    held_out: Sequence[str],
    effects: Sequence[str | AbstractEffect] | str | None,
    max_effects: int,
    strain: tuple[float, float] | None,
    noise: float | None,
    most_samples: int,
    progress: Say | None,
    loading: float | None,
    computed: bool = False,
) -> _Asked:
    """Return the task that runs, model and candidates make; parameters as in `run_loop`."""
    if max_effects < 0:
        raise InputError(f"max_effects must be 0 or more; got {max_effects}.")
    say = progress or (lambda line: None)
    fitted, held, spikes = split_runs(dataset, fit, held_out, strain, most_samples)
    for some in (fitted, held):
        with_loadings(some, loading, noise)  # for what it refuses
    declared, every, _ = with_places(declared, [*fitted, *held], [])
    fitted, held = every[: len(fitted)], every[len(fitted) :]
    require_samples(fitted, declared)
    candidates = candidates_beside(declared, effects, [*fitted, *held])
    of_rates = unfelt_scatter(declared, fitted)
    if of_rates:
        fitted, held = [*map(smoothed, fitted)], [*map(smoothed, held)]
    task = Task(candidates, fitted, held, noise, loading or 0.0, max_effects, say, computed)
    return _Asked(task, declared, dataset.names, spikes, of_rates)


@dataclass(frozen=True)
class Task:
    """Among which effects to search, in which runs.

    Attributes
    ----------
    fitted, held_out
        Runs to fit, and runs that only test.
    noise, loading
        Relative noise where it is known, and deviation of loadings, zero where there are none.
    most
        Largest number of effects.
    say
        Called with a line of text now and then.
    computed
        Whether runs were computed, without an instrument.
    """

    candidates: Sequence[AbstractEffect]
    fitted: Sequence[Run]
    held_out: Sequence[Run]
    noise: float | None
    loading: float
    most: int
    say: Say
    computed: bool = False

    def problem(self, declared: DeclaredModel) -> Problem:
        """Return the problem that a declared model makes of the runs."""
        admitted = admission(self.fitted, self.held_out)
        known = {effect.name for effect in declared.effects}
        candidates = [e for e in self.candidates if admitted(e) and e.name not in known]
        return Problem(
            declared, candidates, self.fitted, self.held_out, self.loading, self.noise,
            self.computed,
        )  # fmt: skip

    def explained(self, declared: DeclaredModel) -> Posterior:
        """Return the posterior over what a declared model lacks.

        Raises
        ------
        InputError
            If it cannot be integrated through the fitted runs.
        """
        problem = self.problem(declared)
        self.say(f"search among {len(problem.candidates)} effects")
        if not is_sound(problem):
            raise InputError(
                "The declared model cannot be integrated through the fitted runs: " + _DIVERGES
            )
        return explain(problem, self.most, self.say)

    def choose(
        self, declared: DeclaredModel, laws: Sequence[str]
    ) -> tuple[DeclaredModel, dict[str, Search]]:
        """Return the declared model with the likeliest of some laws, and the search with each.

        Raises
        ------
        InputError
            If a name is none, or no law can be integrated through the fitted runs.
        """
        unknown = [name for name in laws if name not in LAWS]
        if unknown:
            raise InputError(unknown_name("law", unknown[0], LAWS))
        found: dict[str, Search] = {}
        for name in dict.fromkeys(laws):
            self.say(f"law {len(found) + 1} of {len(laws)}: {LAWS[name].title}")
            problem = self.problem(with_law(declared, name))
            found[name] = Search(Fitter(problem, problem.fitted), self.most).run()
        if not found:
            return declared, found
        best = max(found, key=lambda name: log_evidence(found[name]))
        if not np.isfinite(log_evidence(found[best])):
            raise InputError(
                f"None of the laws {', '.join(laws)} can be integrated through the fitted runs: "
                "their stress diverges. Check modes and units."
            )
        return found[best].problem.declared, found

    def lines(self, found: Mapping[str, Search]) -> tuple[LawFit, ...]:
        """Return the laws that were tried, the likeliest first."""
        logs = {name: log_evidence(search) for name, search in found.items()}
        total, lines = float(np.logaddexp.reduce(list(logs.values()))), []
        for name in sorted(found, key=lambda name: -logs[name]):
            search = found[name]
            alive = search.alive()
            if not alive:
                lines.append(LawFit(name, starting_values(name)))
                continue
            best, declared = alive[0], search.problem.declared
            values, ends = {}, []
            for i, parameter in enumerate(declared.free_parameters):
                value = float(np.clip(best.theta[2 + i], parameter.low, parameter.high))
                values[parameter.name] = value
                room = _AT_END * (parameter.high - parameter.low)
                if min(value - parameter.low, parameter.high - value) < room:
                    ends.append(parameter.name)
            problem, records = search.problem, []
            for rows, held in ((problem.fitted, False), (problem.predicted, True)):
                if rows is not None:
                    own = predicted(search, best, rows, held)[None]
                    records += record_runs(rows.runs, own, held)
            error = errors_of(records, 0)
            probability = float(np.exp(logs[name] - total))
            lines.append(LawFit(name, values, tuple(ends), error, probability, best.names))
        return tuple(lines)


def log_evidence(search: Search) -> float:
    """Return the log of evidence times prior of all hypotheses of a search together."""
    alive = search.alive()
    return float(np.logaddexp.reduce([search.rank(fit) for fit in alive])) if alive else -np.inf


def is_sound(problem: Problem) -> bool:
    """Return whether the model without any effect can be integrated through the fitted runs."""
    predicted = Fitter(problem, problem.fitted).predict([problem.zero])
    return bool(np.all(np.isfinite(predicted)))


def without_fluid(posterior: Posterior) -> bool:
    """Return whether noise and instrument errors alone, without a fluid, are as likely.

    Such records hold no curve beside their noise either; where they do, it is the model that is
    wrong.
    """
    search, problem = posterior.search, posterior.problem
    alive = search.alive()
    if not alive:
        return False
    off = copy(problem)
    off.moduli = np.append(_OFF * problem.declared.modulus, 0.0)
    off.modulus_root = None
    fluid = {e.name for e in problem.effects.values() if isinstance(e, ConstitutiveEffect)}
    off.candidates = tuple(e for e in problem.candidates if e.name not in fluid)
    fitter = Fitter(off, problem.fitted)
    names = {(), tuple(name for name in alive[0].names if name not in fluid)}
    fits = Search(fitter).add([fitter.start(one, problem.zero) for one in names])
    best = max(fits, key=lambda fit: fit.log_evidence)
    if not np.isfinite(best.log_evidence):
        return False
    lost = search.rank(alive[0]) - best.log_evidence - problem.log_prior(best.names)
    return bool(lost < 0.0 and Discrepancy(fitter, best).log_factor < 0.0)


def _by_mode(task: Task, first: Posterior) -> Posterior:
    """Return the posterior with constants that differ from mode to mode, if that is likelier.

    Of a model with several modes: those that it declares so, or else what was found and may differ.
    """
    declared = first.problem.declared
    if len(declared.modulus) < 2 or not first.explanations:
        return first
    if declared.by_mode:
        other = replace(declared, by_mode=())
    else:
        names = tuple(
            name
            for name in first.explanations[0].members[0]
            if may_differ_by_mode(first.problem.effects[name])
        )
        if not names:
            return first
        other = replace(declared, by_mode=names)
    task.say("constants that may differ from mode to mode")
    second = task.explained(other)
    gain = 2.0 * (log_evidence(second.search) - log_evidence(first.search))
    first.memory["by_mode"] = second.memory["by_mode"] = abs(gain)
    return second if gain > 0.0 else first


def with_law(
    declared: DeclaredModel, name: str, values: Mapping[str, float] | None = None
) -> DeclaredModel:
    """Return the declared model with another law, all of whose constants are fitted."""
    factors = {MODULUS: declared.fit_modulus, RELAXATION_TIME: declared.fit_relaxation_time}
    return DeclaredModel.named(
        name,
        starting_values(name) if values is None else values,
        declared.modulus,
        declared.relaxation_time,
        free=[*LAWS[name].parameters, *(factor for factor, free in factors.items() if free)],
        solvent_viscosity=declared.solvent_viscosity,
        linear_error=declared.linear_error,
        linear_pattern=declared.linear_pattern,
        modulus_covariance=declared.modulus_covariance,
        effects=declared.effects,
        step_instants=declared.step_instants,
    )
