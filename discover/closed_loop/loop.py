"""The closed loop: residual, attribution, augmentation, before and after."""

import time
from collections.abc import Callable, Sequence

import numpy as np

from discover.closed_loop.candidates import (
    candidates_of,
    require_possible,
    require_present,
)
from discover.closed_loop.explanations import (
    BEAM_WIDTH,
    explain,
    next_tests,
    over_explanations,
    with_band,
)
from discover.closed_loop.explanations.limits import names_of_limits
from discover.closed_loop.explanations.other_times import FACTOR, compared_with_times, other_times
from discover.closed_loop.final_model import (
    augmented_fluid,
    declared_effects,
    declared_law,
    declared_parameters,
    stage_of,
    states_of,
)
from discover.closed_loop.free_form import free_forms
from discover.closed_loop.free_in_model import free_functions_in_model
from discover.closed_loop.judging.before_after import errors_of, record_runs
from discover.closed_loop.judging.between_samples import (
    change_between_samples,
    coarse_rates,
    judged_with,
    wider_bands,
)
from discover.closed_loop.judging.finer_steps import on_finer_steps
from discover.closed_loop.judging.held_out import held_out as predict_held_out
from discover.closed_loop.judging.judgement import Judgement, judge
from discover.closed_loop.judging.numerical_resolution import NumericalResolution
from discover.closed_loop.judging.silence import Silence, fluid_is_silent, records_are_silent
from discover.closed_loop.judging.told_by_kinds import told_by_kinds
from discover.closed_loop.results.error_pair import ErrorPair
from discover.closed_loop.results.explanation import Explanations
from discover.closed_loop.results.free_curve import FreeForm
from discover.closed_loop.results.loop_result import LoopResult
from discover.closed_loop.results.next_test import NextTests
from discover.closed_loop.runs import MOST_SAMPLES, require_samples, split_runs, with_later_spikes
from discover.closed_loop.search import Search
from discover.closed_loop.search.checkpoint import Store
from discover.closed_loop.searching import SearchTask
from discover.dataset import Dataset
from discover.dataset.checking.start import doubts_of_start
from discover.effects import AbstractEffect
from discover.errors import InputError
from discover.forward import DeclaredModel, make_batch
from discover.forward.least_squares import intervals
from discover.forward.modulus_errors import modulus_shifts
from discover.forward.step_instants import instants_found, with_own_instants, with_places
from discover.inference.by_mode import constants_by_mode
from discover.inference.evidence import WINDOW
from discover.statistics.residual import summarise


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
    dataset
        All runs.
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

    Raises
    ------
    InputError
        If runs, window or effects are not as they should be.
    """
    started = time.perf_counter()
    say = progress or (lambda line: None)
    fitted_runs, held_runs, spikes = split_runs(dataset, fit, held_out, strain, most_samples)
    candidates = candidates_of(effects)
    if max_effects < 0:
        raise InputError(f"max_effects must be 0 or more; got {max_effects}.")
    declared, fitted_runs, held_runs = with_places(declared, fitted_runs, held_runs)
    require_samples(fitted_runs, declared)
    known = {effect.name for effect in declared.effects}
    require_present(declared, {*known, *(effect.name for effect in candidates)})
    candidates = [effect for effect in candidates if effect.name not in known]
    require_possible(declared, [*fitted_runs, *held_runs])
    silent = records_are_silent(fitted_runs)
    ended = SearchTask(
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
    ).search(declared, laws)
    declared, search, carried = ended.declared, ended.search, ended.carried
    model, batch, held_batch = search.model, search.batch, search.held_batch
    tolerated = search.tolerated
    active, thetas = search.active, search.path
    search.fit = current = on_finer_steps(model, batch, fitted_runs, search.fit, active)
    if held_batch is not None:
        held_runs = with_own_instants(model, current.theta, held_runs)
        held_batch = make_batch(held_runs)
    order = dataset.names
    records = record_runs(model, batch, fitted_runs, thetas, held_out=False, order=order)
    judging = []
    if held_batch is not None:
        judging = record_runs(model, held_batch, held_runs, thetas, held_out=True, order=order)
        records += judging
    summary = summarise(current.residual, np.asarray(batch.weight))
    shifts = modulus_shifts(model, current.theta, batch)
    bounds = intervals(model, batch, current, shifts)
    share = float(np.mean(current.run_errors))
    unknown = change_between_samples(model, batch, fitted_runs, current.theta, active, share)
    coarse = None
    if unknown is not None:
        coarse, bounds = coarse_rates(model, batch, fitted_runs, current, bounds, unknown)
    by_mode = constants_by_mode(model, batch, current, bounds, search.degrees, search.prior)
    differ = {name for name, found in by_mode.items() if found.degree}
    of_law = {p.name: by_mode[p.name] for p in declared.free_parameters if p.name in by_mode}
    after = errors_of(records, len(thetas) - 1)
    held = None
    if held_batch is not None:
        unseen = NumericalResolution(model, held_batch, held_runs)
        held = predict_held_out(model, batch, current, thetas[-1], unseen)
    # as they were recorded: a window of strain may have cut their start off
    whole = dataset.select([run.name for run in fitted_runs]).runs
    mistaken = [run.name for run in whole if any(doubts_of_start(run))]
    unseen_runs = None if held_batch is None else (held_batch, held_runs)
    told = told_by_kinds(model, batch, current, fitted_runs, [*active, *known], unseen_runs, shifts)
    silence: Silence | None = "records" if silent else None
    if not silent and fluid_is_silent(model, batch, current, active):
        silence = "fluid"
    judgement = judge(tolerated, current, active, records, held, silence, mistaken)
    judgement = judged_with(judgement, coarse)
    instants = instants_found(model, current, bounds, fitted_runs, held_runs)
    times = other_times(search, carried, judgement) if carried else []
    judgement, instead = compared_with_times(judgement, active, carried, times)
    for name in instead:
        search.aliases[name] = (*search.aliases.get(name, ()), FACTOR)
    limits = names_of_limits(model, batch, fitted_runs, current, active)
    for name, other in limits.items():
        search.aliases[name] = (*search.aliases.get(name, ()), other)
    side_by_side = Explanations()
    if carried:
        side_by_side = explain(
            model, batch, carried, current, (fitted_runs, held_runs), held_batch, judgement,
            min((one.criterion for one in times), default=np.inf),
        )  # fmt: skip
    over_all = over_explanations(bounds, model, current, carried, side_by_side)
    stages = tuple(
        stage_of(search, name, (bounds, over_all), errors_of(records, i), by_mode.get(name))
        for i, name in enumerate(active, start=1)
    )
    spikes = with_later_spikes(spikes, fitted_runs, judgement)
    forms: tuple[FreeForm, ...] = ()
    following = NextTests()
    if carried:
        tried = [effect.name for effect in candidates if search.admitted(effect)]
        # what explains the fitted runs and not those held out lacks no curve of the fitted ones
        # and what the rate did between its samples is a function of nothing else
        known_rates = coarse is None or not coarse.is_coarse
        if judgement.structured and judgement.carries_over and known_rates:
            forms = free_forms(search, fitted_runs, held_batch, held_runs)
        # a law that fits and misses the runs held out may stand for a function inside the model
        if (judgement.structured or not judgement.carries_over) and known_rates:
            forms += free_functions_in_model(search, fitted_runs, held_batch)
        forms = _most_probable([one for one in forms if not _predicts_worse(one.error, after)])
        following = next_tests(model, batch, carried, side_by_side, fitted_runs, judgement)
        parts = [(batch, records[: len(fitted_runs)]), (held_batch, judging)]
        records = with_band(model, batch, carried, side_by_side, parts, judgement, tried)
        wider = wider_bands(records[: len(fitted_runs)], batch, unknown)
        if held_batch is not None:
            unseen_rates = change_between_samples(
                model, held_batch, held_runs, current.theta, active, share
            )
            wider += wider_bands(records[len(fitted_runs) :], held_batch, unseen_rates)
        records = wider
    fluid = augmented_fluid(model, current, [*active, *known])
    states = states_of(model, current, [*active, *known])
    return LoopResult(
        verdict=judgement.verdict,
        error_before=errors_of(records, 0),
        error_after=after,
        noise_floor=judgement.left.noise,
        stages=stages,
        remaining={
            "structured": judgement.structured,
            "error": after.fit,
            "noise_floor": judgement.left.noise,
            "noise_unsure": judgement.left.noise_unsure,
            "outliers": sum(map(len, spikes.values())),
            "outlier_times_s": spikes,
            "probability": judgement.left.probability,
            "resolution": judgement.resolution,
            "sampled_rate": {} if coarse is None else coarse.to_json(),
            "noise_known": judgement.noise_known,
            "carries_over": judgement.carries_over,
            "without_fluid": silence is not None,
            "not_judging": list(judgement.not_judging),
            "linear_error": declared.linear_error,
            "autocorrelation": float(np.mean(summary.autocorrelation)),
            "worst_run": judgement.worst.name,
            "worst_run_error": float(judgement.worst.errors[-1]),
            "description": _with_refusals(judgement, search),
            "step_instants": instants,
            "not_named": {n: text for n, text in search.not_named.items() if n not in active},
        },
        rankings=tuple(search.rankings),
        records=tuple(records),
        declared_parameters=declared_parameters(declared, current, (bounds, over_all)) | of_law,
        declared_effects=declared_effects(model, current, bounds, by_mode),
        declared_law=None if differ & {*of_law} else declared_law(declared, current),
        explanations=side_by_side,
        next_tests=following,
        laws=ended.laws,
        free_form=forms,
        told_by=told,
        fluid=None if differ or states != () else fluid,
        fluid_at_mean=fluid if differ or states else None,
        states=states or (),
        seconds=time.perf_counter() - started,
    )


def _most_probable(forms: Sequence[FreeForm]) -> tuple[FreeForm, ...]:
    """Return free functions of any place, the most probable first, none beyond Occam's window."""
    ranked = sorted(forms, key=lambda one: -one.evidence)
    return tuple(one for one in ranked if one.evidence >= ranked[0].evidence - 2.0 * np.log(WINDOW))


def _predicts_worse(error: ErrorPair, than: ErrorPair) -> bool:
    """Return whether runs that no fit saw speak against what explains those that were fitted."""
    missed = error.held_out or 0.0
    return not np.isfinite(missed) or missed > (than.held_out or np.inf)


def _with_refusals(judgement: Judgement, search: Search) -> str:
    """Return the verdict's reasons, with the effects that fitted and cannot be what is missing."""
    refused = [search.not_named[name] for name in sorted(search.refused)]
    if not judgement.structured or not refused:
        return judgement.description
    return f"{judgement.description} {' '.join(f'{text}.' for text in refused)}"
