"""Is what a model leaves of the records noise? One answer, for a comparison and for a loop."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from discover.statistics.residual import (
    STRUCTURE,
    Expectation,
    noise_probability,
    summarise,
    tells_noise,
)

FitVerdict = Literal["explained", "unexplained", "no_signal"]


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


def lack_of_fit(
    residuals: Sequence[Float[np.ndarray, " _"]],
    measured: Sequence[Float[np.ndarray, " _"]],
    expectation: Expectation | None = None,
) -> LackOfFit:
    """Return what a model leaves of the records, and whether that is noise.

    Parameters
    ----------
    residuals
        Prediction minus measurement of each fitted run, in any unit.
    measured
        The measurements, in the same unit.
    expectation
        What a complete model may leave; by default noise of unknown size.
    """
    expectation = expectation or Expectation()
    longest = max(len(row) for row in measured)
    residual, weight = np.zeros((2, len(measured), longest))
    for i, (row, record) in enumerate(zip(residuals, measured, strict=True)):
        size = float(np.sqrt(np.mean(record**2))) or 1.0
        weight[i, : len(record)] = 1.0 / (size * np.sqrt(len(record)))
        residual[i, : len(record)] = row * weight[i, : len(record)]
    summary = summarise(residual, weight)
    misfit = float(np.mean(np.sqrt(np.sum(residual**2, axis=1))))
    expected = expectation.size(residual, weight)
    known = expectation.noise is not None or tells_noise(weight)
    explained = known and expectation.explains(residual, weight)
    if explained:
        reason = f"what is left ({100 * misfit:.2g} %) is noise"
    elif misfit > STRUCTURE * expected:
        reason = f"what is left ({100 * misfit:.2g} %) is more than noise ({100 * expected:.2g} %)"
    else:
        reason = f"what is left ({100 * misfit:.2g} %) has a pattern that noise has not"
    return LackOfFit(
        "explained" if explained else "unexplained",
        misfit,
        expectation.floor(residual, weight),
        float(np.mean(summary.autocorrelation)),
        noise_probability(residual, weight),
        reason=reason,
    )
