"""The closed loop: what a declared model lacks, judged by runs held out, or each in turn."""

import time
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from discover.dataset import Dataset
from discover.effects import AbstractEffect, ConstitutiveEffect
from discover.errors import InputError
from discover.forward import DeclaredModel
from discover.inference import Posterior
from discover.inference.design import NextTests, design
from discover.inference.discrepancy import DiscrepancyModel
from discover.inference.fits import Fitter
from discover.inference.free_form import FreeForm
from discover.inference.free_functions import free_functions
from discover.inference.posterior import posterior_of
from discover.inference.search import Search
from discover.loop import final_model
from discover.loop.expected_errors import spread_of_laws
from discover.loop.from_posterior import FinishedSearch
from discover.loop.loop_result import LoopResult
from discover.loop.parts import Fold
from discover.loop.preference import with_function_first, with_named_law_first
from discover.loop.remaining import remaining
from discover.loop.runs import errors_of
from discover.loop.search_time import SearchTime
from discover.loop.simple import simple_material_result
from discover.loop.task import Task
from discover.processor import in_one_thread
from discover.progress import Progress, by_time
from discover.study.data import StudyData, temperature
from discover.study.declared_model import StudyModel, forward_model
from discover.study.schema import Study
from discover.words import counted

MOST_LISTED = 8
"""Explanations that are listed by default."""

_OFF = 1e-30  # Factor on the moduli of a fluid that is switched off


@in_one_thread
def run_loop(
    dataset: Dataset, declared: DeclaredModel, *, explanations: int = MOST_LISTED,
    laws: Sequence[str] = (), **asked: Any,
) -> LoopResult:  # fmt: skip
    """Find what a declared model lacks, add it, and test the result on held-out runs.

    Hypotheses are sets of effects added to the declared model, which is never exact: small
    instrument errors are fitted jointly. All are weighed by evidence and prior, unknown effects
    among them; see `discover.inference`. Nothing is random.

    `explanations`: how many are listed. `laws`: named laws to choose the declared one from, by the
    fitted runs alone, each with its likeliest further effects. `**asked`: as of `Task.of_runs`.

    Raises InputError as `Task.of_runs`, or if the model diverges in the fitted runs.
    """
    started = time.perf_counter()
    task = Task.of_runs(dataset, declared, **asked)
    found = search(task, laws)
    result = found.material() if task.most else None
    if result is None:
        found = found.with_curves()
        task.say("bands, intervals and the next test")
        result = found.result(explanations)
    return replace(result, seconds=time.perf_counter() - started)


def run_study(
    study: Study,
    data: StudyData,
    declared: StudyModel,
    progress: Progress | None = None,
    effects: Sequence[str | AbstractEffect] | str | None = None,
) -> LoopResult:
    """Close the loop as a study asks, and judge it by the runs held out: some, or each in turn.

    `progress`: called with a line of text now and then, and about what fraction is done. `effects`:
    candidates in place of the study's.
    """
    options: dict[str, Any] = dict(study.loop) | {"laws": declared.choice, "fit": data.fit.names}
    options |= {} if effects is None else {"effects": effects}
    model, tell = forward_model(declared), by_time(progress)
    rounds = 1 + len(data.fit) if data.each else 1
    sheared = all(run.protocol.control == "rate" and run.flow == "shear" for run in data.fit.runs)
    held_out = data.each or bool(len(data.held_out))
    several = len(model.modulus) > 1
    left = SearchTime(study.loop.max_effects, several, rounds, held_out, sheared)

    def say(line: str) -> None:
        tell(line, left.heard(line))

    if data.each:
        result = run_loop_on_each(data.dataset, model, progress=say, **options)
    else:
        held = data.held_out.names
        result = run_loop(data.dataset, model, held_out=held, progress=say, **options)
    result = titled(result, study, data)
    return replace(result, described=_described(result, study, data, declared))


def titled(result: LoopResult, study: Study, data: StudyData) -> LoopResult:
    """Return a result with the title, the tolerance and the temperature of its study."""
    title = data.dataset.name if study.path is None else study.name
    at = temperature(study, data.dataset)
    return replace(result, title=title, tolerance=study.verdict.tolerance, temperature_C=at)


def _described(result: LoopResult, study: Study, data: StudyData, declared: StudyModel) -> str:
    """Return the data and the declared model in words."""
    dataset, window = data.dataset, study.loop.strain
    strain = "" if window is None else f", strain {window[0]:g} to {window[1]:g}"
    held_out = "each held out in turn" if data.each else f"{len(data.held_out)} held out"
    known = ", ".join(effect.text for effect in declared.effects)
    law = declared.described
    if result.laws:
        law = f"{result.laws[0].title}, chosen of {len(result.laws)} laws"
    return (
        f"Data: {dataset.name}, {counted(len(data.fit), 'run')} fitted, {held_out}{strain}"
        f". Declared model: {law}, {declared.modes_in_words}"
        f"{f'; known effects: {known}' if known else ''}. "
        f"{f'{declared.source} ' if declared.source else ''}{dataset.left_out} {dataset.thinned}"
    ).strip()


def run_loop_on_each(
    dataset: Dataset,
    declared: DeclaredModel,
    fit: Sequence[str] | None = None,
    progress: Callable[[str], None] | None = None,
    **options: Any,
) -> LoopResult:
    """Close the loop on all runs, and judge it by loops that each leave one run out.

    What is found comes from all runs. The held-out errors are means over loops that search afresh
    without one run, so that neither its stress nor the choice of effects has seen it   [Stone 1974,
    J. R. Stat. Soc. B 36, 111]. They judge the way of finding a law rather than the one law found.

    `fit`: names of the runs; by default all. Raises InputError as `run_loop`, or if there are fewer
    than two runs.
    """
    names = list(dataset.names if fit is None else fit)
    if len(names) < 2:
        raise InputError(
            f"To hold out each run in turn, at least 2 are needed; got {len(names)}. Fit without "
            "held-out runs, or measure more."
        )
    say = progress or (lambda line: None)

    def loop(name: str, fitted: Sequence[str], held_out: Sequence[str] = ()) -> LoopResult:
        options["progress"] = lambda line: say(f"{name}: {line}")
        return run_loop(dataset, declared, fit=fitted, held_out=held_out, **options)

    whole, folds = loop("all runs", names), []
    for name in names:
        part = loop(f"without {name}", [other for other in names if other != name], [name])
        before, after = part.error_before.held_out, part.error_after.held_out
        assert before is not None  # one run is held out
        assert after is not None
        found = tuple(stage.effect for stage in part.stages)
        folds.append(Fold(name, part.verdict, found, before, after))
    before, after = (
        float(np.mean([getattr(fold, error) for fold in folds]))
        for error in ("error_before", "error_after")
    )
    return replace(
        whole,
        error_before=replace(whole.error_before, held_out=before),
        error_after=replace(whole.error_after, held_out=after),
        folds=tuple(folds),
    )


@dataclass(frozen=True)
class SearchOutcome:
    """What a search found in runs, before it is reported.

    `task`: what was searched. `posterior`: over the hypotheses that were fitted. `tried`: the
    search with each law that the declared one was chosen from. `curves`: free functions of one
    variable that are likelier than all that has a name.
    """

    task: Task
    posterior: Posterior
    tried: Mapping[str, Search]
    curves: Sequence[FreeForm] = ()

    def material(self) -> LoopResult | None:
        """Return the result where a yield stress, a viscous fluid or a solid is all that is there.

        None for records that noise and instrument errors alone explain, as of a dead sensor.
        """
        found = simple_material_result(self.task, self.posterior)
        return None if found is None or without_fluid(self.posterior) else found

    def with_curves(self) -> "SearchOutcome":
        """Return what was found with free functions of one variable among the hypotheses."""
        self.task.say("curves of one variable")
        posterior = self.posterior
        curves = free_functions(posterior)
        if curves and curves[0].log_odds > 0.0:
            # the law beside it may be one that the search passed over, and what it is have a name
            search = posterior.search.copied()
            if search.improves_with_another_effect(curves[0].fits[0][0]):
                posterior = posterior_of(search, posterior)
                curves = free_functions(posterior)
        if not curves:
            return replace(self, posterior=posterior)
        shown = [curve.form for curve in curves if curve.is_shown]
        return replace(self, posterior=posterior.with_curves(curves), curves=shown)

    @cached_property
    def _reported(self) -> Posterior:
        first = with_function_first(self.posterior)
        return first if first is not self.posterior else with_named_law_first(first)

    def ended(self, explanations: int = MOST_LISTED) -> FinishedSearch:
        """Return what is reported of the posterior, with so many explanations at most."""
        posterior = self._reported
        ahead = [one.form for one in posterior.curves if one.fits is posterior.predictive_mixture]
        curves = [
            replace(form, in_answer=any(form is one for one in ahead)) for form in self.curves
        ]
        return FinishedSearch(posterior, without_fluid(posterior), explanations, curves)

    def result(self, explanations: int = MOST_LISTED) -> LoopResult:
        """Return the result of a closed loop."""
        task, ended = self.task, self.ended(explanations)
        problem, theta = ended.posterior.problem, ended.theta
        declared, model, by_mode = problem.declared, problem.model, ended.by_mode
        present = [*ended.fit.names, *(known.name for known in declared.effects)]
        fluid = final_model.augmented_fluid(model, theta, present)
        states = final_model.states_of(model, theta, present)
        whole = bool(by_mode) or states != ()
        own = final_model.declared_parameters(declared, theta, ended.bounds)
        of_law = {name: one for name, one in by_mode.items() if name in own}
        # only what is fitted of a known effect has an interval
        free = {at: ends for at, ends in ended.bounds.items() if at in model.free_positions}
        stages = ended.stages()
        tests = NextTests()
        if not ended.without_fluid:
            with np.errstate(invalid="ignore"):  # laws that diverge in a test
                tests = design(ended.posterior)
        spread = {} if ended.without_fluid else spread_of_laws(ended.posterior, ended.fit)
        if ended.oil_twin and "N1" in spread:  # of which an oil has none
            spread["N1"] = replace(spread["N1"], inside=1.0, beyond=1.0)
        return LoopResult(
            verdict=ended.verdict,
            error_before=errors_of(ended.records, 0),
            error_after=errors_of(ended.records, -1),
            noise_floor=ended.noise,
            stages=stages,
            remaining=remaining(ended, task.spikes, task.of_rates),
            rankings=ended.rankings(),
            records=tuple(ended.records),
            unfitted=() if ended.without_fluid else tuple(ended.records_of_unfitted(task.unfitted)),
            declared_parameters=own | of_law,
            declared_effects=final_model.declared_effects(model, theta, free, by_mode),
            declared_law=final_model.declared_law(declared, theta, of_law),
            explanations=ended.explanations,
            next_tests=tests,
            laws=task.lines(self.tried) if self.tried else (),
            free_form=tuple(ended.curves),
            discrepancy=ended.discrepancy,
            spread_of_laws=spread,
            left_out=ended.left_out,
            corrections=ended.corrections(),
            nearest_law=ended.posterior.memory.get("named"),
            fluid=None if whole else fluid,
            fluid_at_mean=fluid if whole else None,
            states=states or (),
        )


def search(task: Task, laws: Sequence[str] = ()) -> SearchOutcome:
    """Search, with the likeliest of some laws in place of the declared one.

    Raises InputError as `Task.choose` and `Task.explained`.
    """
    declared, tried = task.choose(laws)
    return SearchOutcome(task, task.explained(declared), tried)


def without_fluid(posterior: Posterior) -> bool:
    """Return whether noise and instrument errors alone, without a fluid, are as likely.

    Such records hold no curve besides their noise either; where they do, it is the model that is
    wrong.
    """
    search, problem = posterior.search, posterior.problem
    alive = search.ranked()
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
    return bool(lost < 0.0 and DiscrepancyModel(fitter, best).log_factor < 0.0)
