"""The closed loop: residual, attribution, augmentation, before and after."""

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from discover.closed_loop.beyond_the_search import beyond_the_search
from discover.closed_loop.candidates import (
    candidates_of,
    require_possible,
    require_present,
)
from discover.closed_loop.explanations import (
    BEAM_WIDTH,
    explain,
    modes_over_explanations,
    over_explanations,
    weighed_constants,
    why_untested,
)
from discover.closed_loop.final_fit import FinalConstants, FinalFit, final_constants, final_fit
from discover.closed_loop.final_model import (
    augmented_fluid,
    declared_effects,
    declared_law,
    declared_parameters,
    stage_of,
    states_of,
    with_shared_interval,
)
from discover.closed_loop.judging.judgement import Judgement
from discover.closed_loop.judging.silence import records_are_silent
from discover.closed_loop.judging.told_by_kinds import told_by_kinds
from discover.closed_loop.own_noise import searched_by_noise
from discover.closed_loop.results.explanation import Explanations
from discover.closed_loop.results.loop_result import LoopResult
from discover.closed_loop.runs import (
    MOST_SAMPLES,
    require_samples,
    split_runs,
    with_later_spikes,
)
from discover.closed_loop.search import Search
from discover.closed_loop.search.checkpoint import Store
from discover.closed_loop.searching import SearchResult, SearchTask
from discover.closed_loop.verdict import FinalVerdict, verdict_on
from discover.dataset import Dataset, Run
from discover.dataset.records.own_loadings import with_loadings
from discover.effects import AbstractEffect
from discover.errors import InputError
from discover.forward import DeclaredModel
from discover.inference.by_mode.degrees import lowest_not_refuted
from discover.inference.scattered_rates import smoothed, unfelt_scatter
from discover.inference.step_instants import instants_found, with_places
from discover.linear_algebra_threads import in_one_thread
from discover.statistics.residual import summarise


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
    explanations: int = BEAM_WIDTH,
    laws: Sequence[str] = (),
    progress: Callable[[str], None] | None = None,
    store: Store | None = None,
    name: str = "search",
    left_out_in_turn: bool = False,
    loading: float | None = None,
) -> LoopResult:
    """Find what a declared model lacks, add it, and judge it on runs that no fit saw.

    Small strains come first: there the fluid is linear, so what the linear prediction misses is
    the instrument's. Then, at each stage, every effect is scored by its signature beyond what is
    fitted already; the leading ones are refitted together with everything fitted before; chosen
    is the one with the strongest evidence among those that also predict runs left out better.
    Effects made redundant are dropped again. The loop stops when none earns its place. Where the
    held-out flows are faster than the fitted ones by more than a decade, constitutive terms that
    name the rate are not tried: such laws may be ill-posed in fast flow (see
    `ConstitutiveEffect`). Nothing in the loop is random.

    Parameters
    ----------
    declared
        The model to start from.
    fit
        Names of the runs to fit; by default all that are not held out.
    held_out
        Names of the runs that only judge.
    effects
        Candidates, by name, by spelling of a library term, or as objects; ``"named"`` for every
        effect with a name that is no candidate on request alone; by default these and every library
        term up to one invariant.
    max_effects
        Largest number of effects added.
    strain
        Smallest and largest strain of the samples fitted and judged.
    noise
        Relative noise, where it is known; estimated from the residuals otherwise.
    most_samples
        Of a run with more samples at most so many are used, evenly chosen, to fit and to judge; of
        one with little noise fewer, but no fewer than 150.
    explanations
        How many sets of effects are carried side by side, at most.
    laws
        Named laws to choose the declared one from, by the fitted runs alone; see `choose_law`. By
        default it is as it was declared.
    progress
        Called with a line of text now and then.
    store
        Where the search is kept after each stage, so that it goes on there when it was interrupted.
    name
        Of this search among others in the store.
    left_out_in_turn
        Whether other searches leave each of the runs out, and so test what this one finds.
    loading
        Relative standard deviation by which loadings of the sample differ, where each run is one of
        its own: its record is then a factor of its own times what the model predicts, with that
        deviation from one. By default there is no such factor.

    Raises
    ------
    InputError
        If runs, window or effects are not as they should be.
    """
    started = time.perf_counter()
    say = progress or (lambda line: None)
    fitted_runs, held_runs, spikes = split_runs(dataset, fit, held_out, strain, most_samples)
    fitted_runs, held_runs = (
        with_loadings(some, loading, noise) for some in (fitted_runs, held_runs)
    )
    candidates = candidates_of(effects)
    if max_effects < 0:
        raise InputError(f"max_effects must be 0 or more; got {max_effects}.")
    declared, fitted_runs, held_runs = with_places(declared, fitted_runs, held_runs)
    require_samples(fitted_runs, declared)
    known = {effect.name for effect in declared.effects}
    require_present(declared, {*known, *(effect.name for effect in candidates)})
    candidates = [effect for effect in candidates if effect.name not in known]
    require_possible(declared, [*fitted_runs, *held_runs])
    of_scatter = unfelt_scatter(declared, fitted_runs)
    if of_scatter:
        fitted_runs, held_runs = [*map(smoothed, fitted_runs)], [*map(smoothed, held_runs)]
    silent = records_are_silent(fitted_runs)
    task = SearchTask(
        candidates,
        fitted_runs,
        held_runs,
        noise=noise,
        max_effects=max_effects,
        width=explanations,
        silent=silent,
        store=store,
        name=name,
        say=say,
    )
    task, ended = searched_by_noise(task, task.search(declared, laws), declared, laws)
    fitted_runs = list(task.fitted)
    whole = dataset.select([run.name for run in fitted_runs]).runs

    def judged(ended: SearchResult) -> Ended:
        final = final_fit(ended, fitted_runs, held_runs, dataset.names)
        constants = final_constants(final, ended.by_mode)
        return ended, final, constants, verdict_on(final, constants, silent, whole)

    ended, final, constants, verdict = _carrying_over(task, judged(ended), judged)
    declared, search, judgement = ended.declared, ended.search, verdict.judgement
    tested = final.fitted, final.fitted if left_out_in_turn else final.held_out
    side_by_side = Explanations()
    if final.carried:
        side_by_side = explain(
            search, final.beside_benches, tested, final.held_batch, judgement,
            min((one.criterion for one in verdict.other_constants), default=np.inf),
        )  # fmt: skip
    beyond = beyond_the_search(final, constants, judgement, side_by_side, candidates)
    bounds, seen = (
        constants.bounds,
        (final.model, final.fit, final.beside_benches, side_by_side),
    )
    by_mode = modes_over_explanations(constants.by_mode, *seen)
    others = weighed_constants(verdict.other_constants, final.carried, final.active)
    over_all = over_explanations(bounds, *seen, others)
    differ = {name for name, found in by_mode.items() if found.degree}
    own = declared_parameters(declared, final.fit, (bounds, over_all))
    of_law = {n: with_shared_interval(by_mode[n], one) for n, one in own.items() if n in by_mode}
    fluid = augmented_fluid(final.model, final.fit, final.present)
    states = states_of(final.model, final.fit, final.present)
    unseen_runs = None if final.held_batch is None else (final.held_batch, final.held_out)
    return LoopResult(
        verdict=judgement.verdict,
        error_before=final.error_at(0),
        error_after=final.error_after,
        noise_floor=judgement.left.noise,
        stages=tuple(
            stage_of(
                search, name, (bounds, over_all), final.error_at(i), by_mode.get(name),
                constants.possible,
            )
            for i, name in enumerate(final.active, start=1)
        ),
        remaining=_remaining(
            final, constants, verdict, with_later_spikes(spikes, final.fitted, judgement), tested,
            of_scatter,
        ),
        rankings=tuple(search.rankings),
        records=tuple(beyond.records),
        declared_parameters=own | of_law,
        declared_effects=declared_effects(final.model, final.fit, bounds, by_mode),
        declared_law=declared_law(declared, final.fit, {n: by_mode[n] for n in differ & {*of_law}}),
        explanations=side_by_side,
        next_tests=beyond.next_tests,
        laws=ended.laws,
        free_form=beyond.free_form,
        told_by=told_by_kinds(
            final.model, final.batch, final.fit, final.fitted, final.present, unseen_runs,
            final.shifts,
        ),
        fluid=None if differ or states != () else fluid,
        fluid_at_mean=fluid if differ or states else None,
        states=states or (),
        seconds=time.perf_counter() - started,
    )  # fmt: skip


Ended = tuple[SearchResult, FinalFit, FinalConstants, FinalVerdict]
"""A search that has ended, its final model, and what is to be believed of that."""


def _carrying_over(
    task: SearchTask, first: Ended, judged: Callable[[SearchResult], Ended]
) -> Ended:
    """Return a search whose constants by mode carry over to the runs held out, or the first.

    One that no more explains the fitted runs is taken for none. What else would explain the runs is
    followed only in the one that is taken.
    """

    def more(before: Ended) -> Ended | None:
        ended = task.one_degree_more(before[0])
        return None if ended is None else judged(ended)

    last = lowest_not_refuted(first, more, lambda one: not one[-1].judgement.carries_over)
    if last is first or last[-1].judgement.structured:
        return first
    last = judged(task.carried(last[0]))
    return first if last[-1].judgement.structured else last


def _remaining(
    final: FinalFit,
    constants: FinalConstants,
    verdict: FinalVerdict,
    spikes: Mapping[str, Sequence[float]],
    tested: tuple[Sequence[Run], Sequence[Run]],
    of_rates: str,
) -> dict[str, Any]:
    """Return what is left, as the contract names it."""
    search, judgement, coarse = final.search, verdict.judgement, constants.coarse
    left = judgement.left
    summary = summarise(final.fit.residual, np.asarray(final.batch.weight))
    return {
        "structured": judgement.structured,
        "error": final.error_after.fit,
        "noise_floor": left.noise,
        "noise_unsure": left.noise_unsure,
        "outliers": sum(map(len, spikes.values())),
        "outlier_times_s": spikes,
        "probability": left.probability,
        "resolution": judgement.resolution,
        "sampled_rate": {} if coarse is None else coarse.to_json(),
        "noise_known": judgement.noise_known,
        "carries_over": judgement.carries_over,
        "without_fluid": verdict.silence is not None,
        "untested": why_untested(final.model, final.fit, final.active, tested),
        "not_judging": list(judgement.not_judging),
        "weights": {run.name: run.weight for run in final.fitted if run.weight != 1.0},
        "linear_error": final.model.declared.linear_error,
        "autocorrelation": float(np.mean(summary.autocorrelation)),
        "worst_run": judgement.worst.name,
        "worst_run_error": float(judgement.worst.errors[-1]),
        "description": f"{of_rates}. " * bool(of_rates) + _with_refusals(judgement, search),
        "read_as": judgement.read_as,
        "advice": left.advice,
        # of what explains nothing no interval is claimed
        "read_otherwise": "" if judgement.structured else constants.misread_said,
        "step_instants": instants_found(
            final.model, final.fit, constants.bounds, final.fitted, final.held_out
        ),
        "not_named": {n: text for n, text in search.not_named.items() if n not in final.active},
        **_of_loadings(final, judgement.structured),
    }


def _of_loadings(final: FinalFit, structured: bool) -> dict[str, Any]:
    """Return the factors of loadings by name of the run, where runs are loadings of their own."""
    if not final.loading:
        return {}
    found = {}
    for one in final.loadings:
        # beside a law that is missing no interval is claimed
        ci95 = None if structured or one.ci95 is None else [*one.ci95]
        found[one.run] = {"factor": one.factor, "ci95": ci95, "held_out": one.held_out}
    return {"loading_deviation": final.loading, "loading": found}


def _with_refusals(judgement: Judgement, search: Search) -> str:
    """Return the verdict's reasons, with the effects that fitted and cannot be what is missing."""
    refused = [search.not_named[name] for name in sorted(search.refused)]
    if not judgement.structured or not refused:
        return judgement.description
    return f"{judgement.description} {' '.join(f'{text}.' for text in refused)}"
