"""A search that has ended as the result of the loop: everything that is reported, in one object."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from discover.closed_loop.beyond.beyond_the_search import beyond_the_search
from discover.closed_loop.explanations import (
    explain,
    modes_over_explanations,
    over_explanations,
    weighed_constants,
    why_untested,
)
from discover.closed_loop.final_fit import FinalConstants, FinalFit
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
from discover.closed_loop.judging.told_by_kinds import told_by_kinds
from discover.closed_loop.results.explanation import Explanations
from discover.closed_loop.results.loop_result import LoopResult
from discover.closed_loop.runs import with_later_spikes
from discover.closed_loop.search import Search
from discover.closed_loop.searching import SearchResult
from discover.closed_loop.verdict import FinalVerdict
from discover.dataset import Run
from discover.effects import AbstractEffect
from discover.inference.step_instants import instants_found
from discover.statistics.residual import summarise


@dataclass(frozen=True)
class Ended:
    """A search that has ended, its final model, and what is to be believed of that."""

    search: SearchResult
    final: FinalFit
    constants: FinalConstants
    verdict: FinalVerdict


def result_of(
    ended: Ended,
    candidates: list[AbstractEffect],
    noted: tuple[dict[str, list[float]], str],
    left_out_in_turn: bool,
    started: float,
) -> LoopResult:
    """Return the result of a loop.

    Parameters
    ----------
    ended, candidates
        Where it ended, and the effects among which it searched.
    noted
        Times of samples set aside as outliers, by run; and that rates were read with noise which
        the fluid did not feel, in words, empty where not.
    left_out_in_turn
        Whether other searches leave each of the runs out.
    started
        When it started, by `time.perf_counter`.
    """
    final, constants, verdict = ended.final, ended.constants, ended.verdict
    declared, search, judgement = ended.search.declared, ended.search.search, verdict.judgement
    tested = final.fitted, final.fitted if left_out_in_turn else final.held_out
    side_by_side = Explanations()
    if final.carried:
        side_by_side = explain(
            search, final.beside_benches, tested, final.held_batch, judgement,
            min((one.criterion for one in verdict.other_constants), default=np.inf),
        )  # fmt: skip
    beyond = beyond_the_search(final, constants, judgement, side_by_side, candidates)
    bounds = constants.bounds
    seen = final.model, final.fit, final.beside_benches, side_by_side
    by_mode = modes_over_explanations(constants.by_mode, *seen)
    others = weighed_constants(verdict.other_constants, final.carried, final.active)
    over_all = over_explanations(bounds, *seen, others)
    differ = {name for name, found in by_mode.items() if found.degree}
    own = declared_parameters(declared, final.fit, (bounds, over_all))
    of_law = {n: with_shared_interval(by_mode[n], one) for n, one in own.items() if n in by_mode}
    fluid = augmented_fluid(final.model, final.fit, final.present)
    states = states_of(final.model, final.fit, final.present)
    unseen_runs = None if final.held_batch is None else (final.held_batch, final.held_out)
    spikes, of_rates = with_later_spikes(noted[0], final.fitted, judgement), noted[1]
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
        remaining=_remaining(final, constants, verdict, spikes, tested, of_rates),
        rankings=tuple(search.rankings),
        records=tuple(beyond.records),
        declared_parameters=own | of_law,
        declared_effects=declared_effects(final.model, final.fit, bounds, by_mode),
        declared_law=declared_law(declared, final.fit, {n: by_mode[n] for n in differ & {*of_law}}),
        explanations=side_by_side,
        next_tests=beyond.next_tests,
        laws=ended.search.laws,
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
