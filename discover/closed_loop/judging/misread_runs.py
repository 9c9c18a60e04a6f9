"""A model that explains records only up to how each was read: in the verdict, and in constants.

See `discover.statistics.reading.misread`. A fault that describes the runs clearly better refutes
the model. One that is not ruled out by the fitted runs moves the constants, whose intervals hold
either.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from discover.closed_loop.judging.judgement import Judgement
from discover.closed_loop.judging.numerical_resolution import NumericalResolution
from discover.forward import AugmentedModel
from discover.inference.least_squares import Fit
from discover.statistics.reading.misread import (
    POSSIBLE,
    Misread,
    advice,
    clear_misreading,
    misread,
    reads,
)
from discover.statistics.reading.reading_faults import Reading
from discover.statistics.residual import STRUCTURE, Expectation

Bounds = dict[int, tuple[float, float]]


def judged_as_read(
    judgement: Judgement,
    fitted: Sequence[Reading],
    unseen: Sequence[Reading],
    expectation: Expectation,
    resolution: NumericalResolution,
    theta: np.ndarray,
    active: Sequence[str],
) -> Judgement:
    """Return a judgement that another reading of the runs does not refute.

    Parameters
    ----------
    judgement
        Of the final model.
    fitted, unseen
        Runs as it predicts them.
    expectation
        What a complete model may leave; a noise that is given may hold anything.
    resolution
        What arithmetic leaves of the fitted runs.
    theta, active
        The parameters, and the effects in the model.
    """
    if not judgement.explains:
        return judgement
    left = judgement.left
    if expectation.noise is not None and left.misfit <= left.expected:
        return judgement
    sets = [fitted, [*fitted, *unseen]] if unseen else [fitted]
    best = clear_misreading(sets, expectation, 0.0)
    if best is None or best.size <= STRUCTURE * resolution.limit(theta, active, best.size):
        return judgement
    advised = advice(best)
    if best.kind == "factor":
        advised += ", or let each run be a loading of its own ([loop] loading)"
    text = (
        f"{judgement.description} But the records follow the model clearly better {reads(best)}: "
        f"{advised}. Constants beside it would be others, so nothing is explained."
    )
    return replace(judgement.refuted(text, advice=advised), read_as=reads(best))


def holding_misreading(
    bounds: Bounds, fit: Fit, fitted: Sequence[Reading], model: AugmentedModel
) -> tuple[Bounds, Misread | None]:
    """Return intervals that hold with a fault that is not ruled out too, and the fault."""
    found = misread(fitted)
    if found is None or found.probability > POSSIBLE or not len(found.steps):
        return bounds, None
    wider = dict(bounds)
    # factors of loadings, where these are fitted along, are no constants and come last
    for position, step in zip(fit.free, found.steps[: len(fit.free)], strict=True):
        if position not in bounds or not np.isfinite(step):
            continue
        low, high = bounds[position]
        wider[position] = (
            max(low + min(float(step), 0.0), float(model.low[position])),
            min(high + max(float(step), 0.0), float(model.high[position])),
        )
    return wider, found
