"""Factors on the records of runs that are loadings of their own: how large, and whether too large.

See `discover.forward.batches.loadings`. They are no constants of the law. But factors larger than
loadings differ by would stand for a law that is missing.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from discover.closed_loop.judging.judgement import Judgement
from discover.dataset import Run
from discover.forward import AugmentedModel, Batch, names_of_loadings, widths_of
from discover.inference.fit_uncertainty import uncertainty
from discover.inference.least_squares import Fit
from discover.inference.modulus_errors import modulus_shifts, response
from discover.statistics import HALF_BAND
from discover.statistics.noise.independent_samples import independent_samples
from discover.statistics.reading.loadings import ADVICE, LoadingFound, as_too_far, too_far


def factors_of_loadings(
    model: AugmentedModel,
    fitted: tuple[Batch, Fit],
    batch: Batch,
    runs: Sequence[Run],
    held_out: bool = False,
) -> list[LoadingFound]:
    """Return the factors of the loadings of some runs; none where they have none.

    Parameters
    ----------
    model, fitted
        The model, and the fitted runs with the fit that predicts.
    batch, runs, held_out
        The records, of each one run, and whether the fit did not see them.
    """
    fit = fitted[1]
    if batch.records.loadings is None or not fit.usable:
        return []
    trials, widths = [fit.theta], widths_of(model, fit.theta, fit.free)
    for position, width in zip(fit.free, widths, strict=True):
        moved = fit.theta.copy()
        moved[position] += width
        trials.append(moved)
    factors, precision = batch.records.factors(model.predictions(trials, batch))
    if not np.all(np.isfinite(factors)):
        return []
    best, size = factors[0], precision[0]
    by_noise = _excess(model, fit.theta, batch) / np.where(size > 0.0, size, 1e-12)
    by_constants = np.zeros(len(best))
    quantile = HALF_BAND
    if fit.free:
        slopes = (factors[1:] - best) / widths[:, None]
        covariance, quantile = uncertainty(fitted[0], fit.residual, fit.jacobian)
        by_constants = np.einsum("ik,ij,jk->k", slopes, covariance, slopes)
        by_constants += _by_moduli(model, fitted, batch, slopes)
    loading = batch.records.deviation_of_loadings**2
    shrunk = loading / (loading + by_noise)
    half = quantile * np.sqrt(shrunk * by_noise + shrunk**2 * np.maximum(by_constants, 0.0))
    # what constants leave open of a run that they were fitted to is in them already
    far = np.sqrt(loading + by_noise + (by_constants if held_out else 0.0))
    return [
        LoadingFound(name, held_out, 1.0 + f, (1.0 + f - h, 1.0 + f + h), abs(raw) / deviation)
        for name, f, h, raw, deviation in zip(
            names_of_loadings(runs),
            (shrunk * best).tolist(),
            half.tolist(),
            best.tolist(),
            far.tolist(),
            strict=True,
        )
    ]


def judged_by_loadings(
    judgement: Judgement, found: Sequence[LoadingFound], deviation: float
) -> Judgement:
    """Return a judgement that factors larger than loadings differ by refute.

    Parameters
    ----------
    judgement
        Of the final model.
    found
        The factors of all runs.
    deviation
        Standard deviation by which loadings are said to differ.
    """
    worst = too_far(found)
    if worst is None or judgement.verdict == "no_signal":
        return judgement
    refuted = judgement.verdict != "unexplained"
    text = (
        f"{judgement.description} {'But the' if refuted else 'The'} "
        f"{as_too_far(worst, deviation)}{', so nothing is explained' if refuted else ''}."
    )
    if not refuted:
        return replace(judgement, description=text)
    return judgement.refuted(text, advice=ADVICE)


def _excess(
    model: AugmentedModel, theta: np.ndarray, batch: Batch
) -> Float[np.ndarray, " loadings"]:
    """Return the variance of the mean of what is left of each loading, over what was assumed."""
    own = batch.records.loadings
    assert own is not None
    residual = model.residuals([theta], batch)[0]
    found = []
    for rows in own.rows:
        power, count, independent = 0.0, 0, 0.0
        for row in rows:
            values = residual[row, np.asarray(batch.weight)[row] > 0] / own.noise[row]
            power += float(values @ values)
            count += len(values)
            independent += independent_samples(values)
        found.append(power / max(count, 1) * max(count / max(independent, 1.0), 1.0))
    return np.array(found)


def _by_moduli(
    model: AugmentedModel,
    fitted: tuple[Batch, Fit],
    batch: Batch,
    slopes: Float[np.ndarray, "free loadings"],
) -> Float[np.ndarray, " loadings"]:
    """Return the variance of factors by errors of moduli, as a sweep leaves them."""
    fit, own = fitted[1], batch.records.loadings
    shifts = modulus_shifts(model, fit.theta, fitted[0])
    assert own is not None
    if not len(shifts):
        return np.zeros(len(own.members))
    predicted = model.predictions([fit.theta], batch) * np.asarray(batch.weight)
    raw = modulus_shifts(model, fit.theta, batch.without_factors())
    direct = own.factors(raw, np.broadcast_to(predicted, raw.shape))[0]
    return np.sum((direct - response(fit.jacobian, shifts).T @ slopes) ** 2, axis=0)
