"""The closed loop: residual, attribution, augmentation, before and after."""

import time
from collections.abc import Callable, Sequence

from discover.closed_loop.candidates import candidates_beside
from discover.closed_loop.ended import Ended, result_of
from discover.closed_loop.explanations import BEAM_WIDTH
from discover.closed_loop.final_fit import final_constants, final_fit
from discover.closed_loop.judging.silence import records_are_silent
from discover.closed_loop.own_noise import searched_by_noise
from discover.closed_loop.results.loop_result import LoopResult
from discover.closed_loop.runs import MOST_SAMPLES, require_samples, split_runs
from discover.closed_loop.search.checkpoint import Store
from discover.closed_loop.searching import SearchResult, SearchTask
from discover.closed_loop.verdict import verdict_on
from discover.dataset import Dataset
from discover.dataset.records.own_loadings import with_loadings
from discover.effects import AbstractEffect
from discover.errors import InputError
from discover.forward import DeclaredModel
from discover.inference.by_mode.degrees import lowest_not_refuted
from discover.inference.scattered_rates import smoothed, unfelt_scatter
from discover.inference.step_instants import with_places
from discover.linear_algebra_threads import in_one_thread


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
    if max_effects < 0:
        raise InputError(f"max_effects must be 0 or more; got {max_effects}.")
    fitted, held, spikes = split_runs(dataset, fit, held_out, strain, most_samples)
    fitted, held = (with_loadings(some, loading, noise) for some in (fitted, held))
    declared, fitted, held = with_places(declared, fitted, held)
    require_samples(fitted, declared)
    candidates = candidates_beside(declared, effects, [*fitted, *held])
    of_rates = unfelt_scatter(declared, fitted)
    if of_rates:
        fitted, held = [*map(smoothed, fitted)], [*map(smoothed, held)]
    task = SearchTask(
        candidates,
        fitted,
        held,
        noise=noise,
        max_effects=max_effects,
        width=explanations,
        silent=records_are_silent(fitted),
        store=store,
        name=name,
        say=progress or (lambda line: None),
    )
    found = task.search(declared, laws)
    task, found = searched_by_noise(task, found, declared, laws)
    whole = dataset.select([run.name for run in task.fitted]).runs

    def judged(one: SearchResult) -> Ended:
        final = final_fit(one, list(task.fitted), held, dataset.names)
        constants = final_constants(final, one.by_mode)
        return Ended(one, final, constants, verdict_on(final, constants, task.silent, whole))

    ended = _carrying_over(task, judged(found), judged)
    return result_of(ended, candidates, (spikes, of_rates), left_out_in_turn, started)


def _carrying_over(
    task: SearchTask, first: Ended, judged: Callable[[SearchResult], Ended]
) -> Ended:
    """Return a search whose constants by mode carry over to the runs held out, or the first.

    One that no more explains the fitted runs is taken for none. What else would explain the runs is
    followed only in the one that is taken.
    """

    def more(before: Ended) -> Ended | None:
        ended = task.one_degree_more(before.search)
        return None if ended is None else judged(ended)

    last = lowest_not_refuted(first, more, lambda one: not one.verdict.judgement.carries_over)
    if last is first or last.verdict.judgement.structured:
        return first
    last = judged(task.carried(last.search))
    return first if last.verdict.judgement.structured else last
