"""A model that only the error of the linear sweep excuses, held against what that error can do."""

from collections.abc import Sequence

import numpy as np

from discover.closed_loop.judging.judgement import Judgement
from discover.closed_loop.judging.tolerated_misfit import ToleratedMisfit
from discover.statistics.reading.beyond_sweep import ADVICE, REASON, beyond_the_sweep
from discover.statistics.reading.reading_faults import Reading
from discover.statistics.residual import STRUCTURE
from discover.words import percent_of


def judged_beyond_sweep(
    judgement: Judgement,
    fitted: Sequence[Reading],
    unseen: Sequence[Reading],
    tolerated: ToleratedMisfit,
    pattern: float | None,
    theta: np.ndarray,
    active: Sequence[str],
) -> Judgement:
    """Return a judgement in which the sweep excuses no more than errors of its moduli change.

    Parameters
    ----------
    judgement
        Of the final model.
    fitted, unseen
        Runs as it predicts them.
    tolerated
        What a complete model may leave of the fitted runs; a noise that is given may hold anything.
    pattern
        As in `beyond_the_sweep`.
    theta, active
        The parameters, and the effects in the model.
    """
    expectation = tolerated.expectation
    if not judgement.explains or expectation.noise:
        return judgement
    sets = [fitted, [*fitted, *unseen]] if unseen else [fitted]
    found = [beyond_the_sweep(runs, expectation, pattern) for runs in sets]
    beyond = next((one for one in found if one is not None), None)
    if beyond is None:
        return judgement
    if beyond.misfit <= STRUCTURE * tolerated.resolution.limit(theta, active, beyond.misfit):
        return judgement
    reason = REASON.format(percent_of(beyond.misfit))
    text = f"{judgement.description} But {reason}: {ADVICE}. So nothing is explained."
    return judgement.refuted(text, reason, ADVICE)
