"""Is what a model leaves of the records noise? One answer, for a comparison and for a loop."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from discover.statistics.dead_records import holds_signal
from discover.statistics.outliers import stray
from discover.statistics.residual import (
    STRUCTURE,
    Expectation,
    summarise,
    tells_noise,
)
from discover.statistics.whiteness import noise_probability

FitVerdict = Literal["explained", "unexplained", "no_signal"]

ONLY_NOISE = 0.9
"""A model that misses a record by more of it than this says nothing of it."""


@dataclass(frozen=True)
class LackOfFit:
    """What a model leaves of the records that it was fitted to.

    Attributes
    ----------
    verdict
        ``"explained"`` if it is noise (and the error of the linear data), ``"no_signal"`` if the
        records hold nothing that a law could be told from, ``"unexplained"`` otherwise.
    misfit
        Root-mean-square residual over rms measurement, mean over runs.
    noise
        Relative noise of the records, mean over runs.
    expected
        Relative error that noise and the error of the linear data explain together.
    lag_one_correlation
        Of neighbouring residuals, mean over runs.
    probability
        Of residuals as structured as these, if they are noise; None where every run is too short.
    outliers
        Number of samples that are far outside the noise and do not vote.
    reason
        The verdict in one sentence.
    """

    verdict: FitVerdict
    misfit: float
    noise: float
    lag_one_correlation: float
    probability: float | None
    outliers: int = 0
    reason: str = ""
    expected: float = 0.0


def lack_of_fit(
    residuals: Sequence[Float[np.ndarray, " _"]],
    measured: Sequence[Float[np.ndarray, " _"]],
    expectation: Expectation | None = None,
    rates: Sequence[Float[np.ndarray, " _"]] | None = None,
) -> LackOfFit:
    """Return what a model leaves of the records, and whether that is noise.

    Samples that are outliers (`stray`) are counted and left out.

    Parameters
    ----------
    residuals
        Prediction minus measurement of each fitted run, in any unit.
    measured
        The measurements, in the same unit.
    expectation
        What a complete model may leave; by default noise of unknown size.
    rates
        What was imposed, at the samples; with them a record that never follows it is told.
    """
    expectation = expectation or Expectation()
    residual, weight, record, outliers = _without_outliers(residuals, measured)
    summary = summarise(residual, weight)
    misfit = float(np.mean(np.sqrt(np.sum(residual**2, axis=1))))
    floor = expectation.floor(residual, weight, record)
    expected = float(np.hypot(floor, expectation.linear_error))
    known = expectation.noise is not None or tells_noise(weight)
    explained = known and expectation.explains(residual, weight, record)
    verdict: FitVerdict = "explained" if explained else "unexplained"
    if not holds_signal(measured, rates):
        verdict = "no_signal"
        reason = "the records are noise about a constant, whatever was imposed"
    elif explained and misfit > ONLY_NOISE:
        verdict = "no_signal"
        reason = f"what is left ({100 * misfit:.2g} % of the records) is noise, and nearly all"
    elif explained:
        reason = f"what is left ({100 * misfit:.2g} %) is noise"
    elif misfit > STRUCTURE * expected:
        reason = f"what is left ({100 * misfit:.2g} %) is more than noise ({100 * expected:.2g} %)"
    else:
        reason = f"what is left ({100 * misfit:.2g} %) has a pattern that noise has not"
    if outliers:
        reason += f"; outliers that do not count: {outliers}"
    return LackOfFit(
        verdict,
        misfit,
        floor,
        float(np.mean(summary.autocorrelation)),
        noise_probability(residual, weight, record),
        outliers,
        reason,
        expected,
    )


def _without_outliers(residuals, measured):
    """Return weighted residuals, weights and records, padded, and the number of outliers."""
    kept = []
    for row, record in zip(residuals, measured, strict=True):
        good = ~stray(np.asarray(row, dtype=float), np.asarray(record, dtype=float))
        kept.append((np.asarray(row)[good], np.asarray(record)[good], np.count_nonzero(~good)))
    longest = max(len(row) for row, _, _ in kept)
    residual, weight, record = np.zeros((3, len(kept), longest))
    for i, (row, values, _) in enumerate(kept):
        n = len(values)
        size = float(np.sqrt(np.mean(values**2))) or 1.0
        weight[i, :n] = 1.0 / (size * np.sqrt(n))
        residual[i, :n] = row * weight[i, :n]
        record[i, :n] = values
    return residual, weight, record, int(sum(count for _, _, count in kept))
