"""Is what a model leaves of the records noise? One answer, for a comparison and for a loop."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from discover.statistics.noise.noise_model import rms
from discover.statistics.noise.same_correlation import same_correlation_probability
from discover.statistics.noise.whiteness import (
    FEWEST_FAST,
    FEWEST_TESTED,
    SIGNIFICANCE,
    noise_probability,
)
from discover.statistics.residual import (
    STRUCTURE,
    Expectation,
    lag_one_correlation,
    noise_floor,
)
from discover.words import percent_of

FitVerdict = Literal["explained", "unexplained", "no_signal"]

ONLY_NOISE = 0.9
"""A model that misses a record by more of it than this says nothing of it."""


_PATTERN = "a pattern that noise has not"

_CORRELATED = 0.6
"""Correlation from sample to sample from which on no test tells noise from a smooth misfit that is
less than some three times as large."""

_IF_CORRELATED = (
    "is noise if that is correlated to {:.2g} from sample to sample, and a misfit if not"
)

_PATTERN_OF_SHORT = (
    "a pattern that independent noise has not (runs of fewer than "
    f"{FEWEST_TESTED} samples do not tell correlated noise from a misfit)"
)


@dataclass(frozen=True)
class LackOfFit:
    """What a model leaves of the records that it was fitted to.

    `verdict`: ``"explained"`` if it is noise (and the error of the linear data), ``"no_signal"`` if
        the records hold nothing that a law could be told from, ``"unexplained"`` otherwise.
    `probability`: of residuals as structured as these, if they are noise; None where all runs
        together are too short to look for a pattern.
    """

    verdict: FitVerdict
    misfit: float  # root-mean-square residual over rms measurement, mean over runs
    noise: float  # relative noise of the records, mean over runs
    lag_one_correlation: float  # of neighbouring residuals, mean over runs
    probability: float | None
    reason: str = ""  # the verdict in one sentence

    @property
    def described(self) -> str:
        """How well the model describes the records it was fitted to, in one sentence."""
        if self.verdict == "no_signal":
            return f"The runs hold no signal: {self.reason}."
        if not np.isfinite(self.misfit):
            return f"Does not describe the fitted runs: {self.reason}."
        if self.verdict == "explained":
            return f"Fits within the noise of {percent_of(self.noise or self.misfit)}."
        return (
            f"Describes the fitted runs to {percent_of(self.misfit)}; the rest is systematic "
            f"(noise: {percent_of(self.noise)})."
        )


def lack_of_fit(
    residuals: Sequence[Float[np.ndarray, " _"]],
    measured: Sequence[Float[np.ndarray, " _"]],
    expectation: Expectation | None = None,
    even: Sequence[Float[np.ndarray, " _"]] | None = None,
    intervals: Sequence[float] | None = None,
) -> LackOfFit:
    """Return what a model leaves of the records, and whether that is noise.

    `residuals`: prediction minus measurement of each fitted run, in any unit. `measured`: the
    measurements, in the same unit. `expectation`: what a complete model may leave; by default noise
    of unknown size. `even`: by what records and residuals are multiplied so that their noise has
    one size; by default by nothing. `intervals`: time between neighbouring samples of each run, by
    which the correlations of their noise are held against one another
    (`same_correlation_probability`); not a number of what is recorded otherwise. Without them they
    are not.
    """
    if even is not None:
        residuals, measured = (
            [factor * row for factor, row in zip(even, rows, strict=True)]
            for rows in (residuals, measured)
        )
    expectation = expectation or Expectation()
    records = [np.asarray(record, dtype=float) for record in measured]
    rows = [
        np.asarray(r, dtype=float) / (rms(m) or 1.0)
        for r, m in zip(residuals, records, strict=True)
    ]
    further = () if intervals is None else (same_correlation_probability(rows, intervals),)
    # a run counts as much as any other: one too short to tell its noise could decide alone
    telling = [i for i, row in enumerate(rows) if len(row) >= FEWEST_FAST]
    if telling:
        rows, records = ([some[i] for i in telling] for some in (rows, records))
    misfit = float(np.mean(list(map(rms, rows))))
    probability = noise_probability(rows, records, further)
    floor = noise_floor(rows, probability) if expectation.noise is None else expectation.noise
    expected = float(np.hypot(max(floor, expectation.repeat_error), expectation.linear_error))
    known = expectation.noise is not None or bool(telling)
    explained = known and expectation.explains(rows, probability, floor)
    pattern = _PATTERN if max(map(len, rows)) >= FEWEST_TESTED else _PATTERN_OF_SHORT
    verdict: FitVerdict = "explained" if explained else "unexplained"
    correlation = float(np.mean(list(map(lag_one_correlation, rows))))
    rest = "is noise"
    if correlation >= _CORRELATED and expectation.noise is None and not expectation.repeat_error:
        rest = _IF_CORRELATED.format(correlation)
    if explained and misfit > ONLY_NOISE:
        verdict = "no_signal"
        reason = f"the residual ({percent_of(misfit)} of the data) is noise, and nearly all"
    elif explained and probability is None:
        rest = "is no larger than noise; there are too few samples to look for a pattern in it"
        reason = f"the residual ({percent_of(misfit)}) {rest}"
    elif explained and probability is not None and probability > SIGNIFICANCE:
        reason = f"the residual ({percent_of(misfit)}) {rest}"
    elif explained:
        given = _PATTERNED[expectation.noise is not None, expectation.repeat_error > 0.0]
        rest = f"has a pattern no larger than {given}"
        reason = f"the residual ({percent_of(misfit)}) {rest}"
    elif probability is None and misfit > STRUCTURE * expected and expectation.noise is None:
        reason = (
            f"the residual ({percent_of(misfit)}) is more than changes from sample to sample "
            f"({percent_of(expected)}), but so few samples hardly tell what is noise"
        )
    elif misfit > STRUCTURE * expected:
        reason = f"the residual ({percent_of(misfit)}) is more than noise ({percent_of(expected)})"
    else:
        reason = f"the residual ({percent_of(misfit)}) has {pattern}"
    return LackOfFit(verdict, misfit, floor, correlation, probability, reason)


_PATTERNED = {
    (True, False): "the noise given",
    (True, True): "the noise given",
    (False, False): "the linear data's error",
    (False, True): "the linear data's error and what repeated runs differ by",
}
"""What may have a pattern, by whether the noise is given and whether runs were repeated."""
