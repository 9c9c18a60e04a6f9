"""What a rate did between its samples, which nobody knows: in constants, bands and the verdict."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from discover.closed_loop.judging.finer_steps import change_on_finer_steps, constants_that_follow
from discover.closed_loop.judging.judgement import Judgement
from discover.closed_loop.results.run_record import RunRecord
from discover.dataset import Run
from discover.dataset.records.coarse_rates import CoarseRates, samples_a_cycle, worth_a_look
from discover.forward import MODULUS, RELAXATION_TIME, AugmentedModel, Batch
from discover.inference.least_squares import Fit
from discover.protocols import unknown_between_samples
from discover.statistics.residual import judging

_STRAIN_STEP = 0.25  # that of the fit
_GUESSED = 2.0  # one other curve stands for all that go through the samples

Bounds = dict[int, tuple[float, float]]


def change_between_samples(
    model: AugmentedModel,
    batch: Batch,
    runs: Sequence[Run],
    theta: np.ndarray,
    active: Sequence[str],
    left: float,
) -> Float[np.ndarray, "runs n"] | None:
    """Return how weighted residuals would change with other rates; None where that is nothing."""
    unknown = [unknown_between_samples(run.protocol, run.time) for run in runs]
    if not worth_a_look(unknown, left):
        return None
    return change_on_finer_steps(
        model, batch, runs, theta, active, other_rates=True, strain_step=_STRAIN_STEP
    )


def coarse_rates(
    model: AugmentedModel,
    batch: Batch,
    runs: Sequence[Run],
    fit: Fit,
    bounds: Bounds,
    change: Float[np.ndarray, "runs n"],
) -> tuple[CoarseRates, Bounds]:
    """Return what other rates would change, and intervals that allow for it."""
    shifts: dict[str, float] = {}
    names = {0: MODULUS, 1: RELAXATION_TIME}
    names |= {2 + i: parameter.name for i, parameter in enumerate(model.declared.free_parameters)}
    for effect in model.effects:
        own = zip(model.positions(effect.name), effect.parameters, strict=True)
        names |= {position: parameter.name for position, parameter in own}
    wider = dict(bounds)
    moved, kept = constants_that_follow(fit, change)
    for position, shift in zip(fit.free, np.abs(moved), strict=True):
        if model.instants.start <= position < model.instants.stop:
            continue  # when a rate steps is unknown as it is
        value, (low, high) = float(fit.theta[position]), bounds[position]
        half = max(0.5 * (high - low), np.finfo(float).tiny)
        # what is left are coefficients of a constant by mode
        name = names.get(position, "a_constant_by_mode")
        shifts[name] = max(shifts.get(name, 0.0), float(shift / half))
        wider[position] = (
            max(value - float(np.hypot(value - low, shift)), float(model.low[position])),
            min(value + float(np.hypot(high - value, shift)), float(model.high[position])),
        )
    each = np.sqrt(np.sum(kept**2, axis=1))
    seen = judging(np.asarray(batch.weight))
    left = float(np.mean(fit.run_errors[seen]))
    most = np.sqrt(np.sum(change**2, axis=1))
    where = {
        run.name: samples_a_cycle(run.time, run.rate)
        for run, size in zip(runs, most, strict=True)
        if size > 0.5 * np.max(most)
    }
    return CoarseRates(float(np.mean(each[seen])), left, shifts, where), wider


def judged_with(judgement: Judgement, coarse: CoarseRates | None) -> Judgement:
    """Return the judgement of a model whose rates were read in samples.

    Where what they did between the samples hides all that the model leaves, nothing is explained.
    """
    if coarse is None or not coarse.is_coarse:
        return judgement
    told = replace(judgement, description=f"{coarse.sentence} {judgement.description}")
    if not coarse.hides or not told.explains:
        return told
    return replace(told, verdict="unexplained")


def wider_bands(
    records: Sequence[RunRecord], batch: Batch, change: Float[np.ndarray, "runs n"] | None
) -> list[RunRecord]:
    """Return records whose bands give way by twice the most that changes along each run."""
    if change is None:
        return list(records)
    weight = np.asarray(batch.weight)
    found = []
    for record, weights, off in zip(records, weight, change, strict=True):
        n = len(record.time)
        most = _GUESSED * float(np.max(np.abs(off[:n] / weights[:n])))
        band = None if record.band is None else record.band + most * np.array([[-1.0], [1.0]])
        found.append(replace(record, band=band))
    return found
