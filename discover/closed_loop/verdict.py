"""The verdict on a final model, with what takes the place of effects that were found."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from discover.closed_loop.explanations.limits import names_of_limits
from discover.closed_loop.explanations.other_benches import BENCH, OtherBench, instead_of
from discover.closed_loop.explanations.other_constants import (
    OtherConstants,
    compared_with_constants,
    other_constants,
)
from discover.closed_loop.final_fit import FinalConstants, FinalFit
from discover.closed_loop.judging.between_samples import judged_with
from discover.closed_loop.judging.judgement import Judgement, judge
from discover.closed_loop.judging.left_out_in_turn import judged_in_turn
from discover.closed_loop.judging.loadings import judged_by_loadings
from discover.closed_loop.judging.misread_runs import judged_as_read
from discover.closed_loop.judging.silence import Silence, fluid_is_silent
from discover.closed_loop.judging.sweep_error import judged_beyond_sweep
from discover.closed_loop.judging.terms_beside import judged_beside_terms
from discover.dataset import Run
from discover.dataset.checking.start import doubts_of_start


@dataclass(frozen=True)
class FinalVerdict:
    """What is to be believed of a final model.

    Attributes
    ----------
    judgement
        The verdict with its reasons.
    silence
        What holds no signal, if anything does.
    other_constants
        Declared constants with other values that explain the runs as well.
    """

    judgement: Judgement
    silence: Silence | None
    other_constants: Sequence[OtherConstants]


def verdict_on(
    final: FinalFit, constants: FinalConstants, silent: bool, whole: Sequence[Run]
) -> FinalVerdict:
    """Return what is to be believed of a final model.

    What takes the place of an effect joins the aliases of the search.

    Parameters
    ----------
    final, constants
        The final model on the runs, and its constants.
    silent
        Whether the records are noise about a constant.
    whole
        The fitted runs as they were recorded: a window of strain may have cut their start off.
    """
    search, active, silence = final.search, final.active, _silence(final, silent)
    judgement = judge(
        search.tolerated,
        final.fit,
        active,
        final.records,
        final.unseen(),
        silence,
        [run.name for run in whole if any(doubts_of_start(run))],
    )
    judgement = judged_in_turn(judgement, search.problem, final.fit, active, final.fitted)
    judgement = judged_with(judgement, constants.coarse)
    tolerated = search.tolerated
    judgement = judged_as_read(
        judgement, *final.readings, tolerated.expectation,
        tolerated.resolution, final.fit.theta, active,
    )  # fmt: skip
    judgement = judged_beyond_sweep(
        judgement, *final.readings, tolerated, final.model.declared.linear_pattern,
        final.fit.theta, active,
    )  # fmt: skip
    judgement = judged_by_loadings(judgement, final.loadings, final.loading)
    if final.loading:
        judgement = judged_beside_terms(
            judgement, final.model, final.batch, final.fit.theta, active, final.fitted,
            final.fitted_readings, tolerated,
        )  # fmt: skip
    others = ([] if not final.carried else
              other_constants(search, final.carried, judgement, final.held_batch))  # fmt: skip
    judgement, instead = compared_with_constants(judgement, active, final.carried, others)
    benches = instead_of(final.benches, final.carried, active)
    judgement = _with_benches(judgement, benches.values())
    aliases = [*instead.items(), *((name, BENCH) for name in benches)]
    aliases += names_of_limits(final.model, final.batch, final.fitted, final.fit, active).items()
    for name, other in aliases:
        search.aliases[name] = (*search.aliases.get(name, ()), other)
    return FinalVerdict(judgement, silence, others)


def _with_benches(judgement: Judgement, benches: Iterable[OtherBench]) -> Judgement:
    """Return a judgement with what small faults of the bench do in the place of effects."""
    said = " ".join(one.sentence for one in benches)
    if judgement.structured or not said:
        return judgement
    return replace(judgement, description=f"{judgement.description} {said}")


def _silence(final: FinalFit, silent: bool) -> Silence | None:
    if silent:
        return "records"
    if fluid_is_silent(final.model, final.batch, final.fit, final.active):
        return "fluid"
    return None
