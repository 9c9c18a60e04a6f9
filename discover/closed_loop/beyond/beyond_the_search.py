"""What is told beyond the effects that were found: free functions, next tests, bands."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from discover.closed_loop.beyond.free_form import free_forms
from discover.closed_loop.beyond.free_in_model import free_functions_in_model
from discover.closed_loop.explanations import next_tests, with_band
from discover.closed_loop.final_fit import FinalConstants, FinalFit
from discover.closed_loop.judging.between_samples import wider_bands
from discover.closed_loop.judging.judgement import Judgement
from discover.closed_loop.results.error_pair import ErrorPair
from discover.closed_loop.results.explanation import Explanations
from discover.closed_loop.results.free_curve import FreeForm
from discover.closed_loop.results.next_test import NextTests
from discover.closed_loop.results.run_record import RunRecord
from discover.effects import AbstractEffect
from discover.inference.evidence import WINDOW


@dataclass(frozen=True)
class Beyond:
    """What a loop tells beyond the effects that it found.

    Attributes
    ----------
    records
        All runs with their predictions, and bands where explanations were carried.
    free_form
        Free functions that explain what is left, the most probable first.
    next_tests
        Tests that would tell the explanations apart.
    """

    records: Sequence[RunRecord]
    free_form: tuple[FreeForm, ...] = ()
    next_tests: NextTests = field(default_factory=NextTests)


def beyond_the_search(
    final: FinalFit,
    constants: FinalConstants,
    judgement: Judgement,
    explanations: Explanations,
    candidates: Sequence[AbstractEffect],
) -> Beyond:
    """Return what is told beyond the effects that were found."""
    if not final.carried:
        return Beyond(final.records)
    forms = _free_functions(final, constants, judgement)
    tests = next_tests(
        final.model, final.batch, final.beside_benches, explanations, final.fitted, judgement
    )
    tried = [effect.name for effect in candidates if final.search.admitted(effect)]
    return Beyond(_with_bands(final, constants, judgement, explanations, tried), forms, tests)


def _free_functions(
    final: FinalFit, constants: FinalConstants, judgement: Judgement
) -> tuple[FreeForm, ...]:
    forms: tuple[FreeForm, ...] = ()
    # what the rate did between its samples is a function of nothing else
    if not constants.rates_known:
        return forms
    # what explains the fitted runs and not those held out lacks no curve of the fitted ones
    if judgement.structured and judgement.carries_over:
        forms = free_forms(final.search, final.fitted, final.held_batch, final.held_out)
    # a law that fits and misses the runs held out may stand for a function inside the model
    if judgement.structured or not judgement.carries_over:
        forms += free_functions_in_model(final.search, final.fitted, final.held_batch)
    after = final.error_after
    return _most_probable([one for one in forms if not predicts_worse(one.error, after)])


def _most_probable(forms: Sequence[FreeForm]) -> tuple[FreeForm, ...]:
    """Return free functions of any place, the most probable first, none beyond Occam's window."""
    ranked = sorted(forms, key=lambda one: -one.evidence)
    return tuple(one for one in ranked if one.evidence >= ranked[0].evidence - 2.0 * np.log(WINDOW))


def predicts_worse(error: ErrorPair, than: ErrorPair) -> bool:
    """Return whether runs that no fit saw speak against what explains those that were fitted."""
    missed = error.held_out or 0.0
    return not np.isfinite(missed) or missed > (than.held_out or np.inf)


def _with_bands(
    final: FinalFit,
    constants: FinalConstants,
    judgement: Judgement,
    explanations: Explanations,
    tried: Sequence[str],
) -> list[RunRecord]:
    """Return all runs with bands, which allow for what the rate did between its samples."""
    parts = [(final.batch, final.records_fitted), (final.held_as_noisy, final.records_held_out)]
    records = with_band(
        final.model, final.batch, final.beside_benches, explanations, parts, judgement, tried
    )
    count = len(final.records_fitted)
    wider = wider_bands(records[:count], final.batch, constants.unknown)
    if final.held_batch is not None:
        unseen_rates = final.between_samples(final.held_batch, final.held_out)
        wider += wider_bands(records[count:], final.held_batch, unseen_rates)
    return wider
