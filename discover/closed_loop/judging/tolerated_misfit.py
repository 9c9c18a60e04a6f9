"""What a fit leaves, held against what a complete model would leave."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float

from discover.closed_loop.judging.numerical_resolution import NumericalResolution
from discover.forward import even
from discover.inference.least_squares import Fit
from discover.protocols.kinematics import STATES
from discover.protocols.sampling import sampling_interval
from discover.statistics.lack_of_fit import PATTERN, LackOfFit, what_is_left
from discover.statistics.noise.whiteness import SIGNIFICANCE, separate_probability
from discover.statistics.projection import rms
from discover.statistics.residual import FEWEST_FAST, STRUCTURE, Expectation, slow_part, tells_noise
from discover.words import percent_of


@dataclass(frozen=True)
class ToleratedMisfit:
    """What a complete model may leave of some runs: noise, error of the linear data, arithmetic.

    Attributes
    ----------
    expectation
        Noise, and the error of the linear data.
    resolution
        What arithmetic leaves of these runs.
    """

    expectation: Expectation
    resolution: NumericalResolution

    @property
    def weight(self) -> Float[np.ndarray, "runs n"]:
        """Weights of the runs, zero at padding."""
        return np.asarray(self.resolution.batch.weight)

    @property
    def records(self) -> Float[np.ndarray, "runs n"]:
        """Measured stress in Pa, padded."""
        return np.asarray(self.resolution.batch.recorded)

    def on(self, resolution: NumericalResolution) -> "ToleratedMisfit":
        """Return the same expectation of other runs."""
        return ToleratedMisfit(self.expectation, resolution)

    def unresolved(self, fit: Fit, active: Sequence[str]) -> bool:
        """Return whether what a fit leaves is no more than arithmetic leaves."""
        error = self.resolution.mean(fit.run_errors)
        if self.resolution.beyond_steps(fit.residual):
            return False
        return error <= STRUCTURE * self.resolution.limit(fit.theta, active, error)

    @cached_property
    def _intervals(self) -> list[float]:
        runs = self.resolution.runs
        return [sampling_interval(run.time, run.protocol, run.quantity) for run in runs]

    @property
    def noise_known(self) -> bool:
        """Whether noise can be told from structure: it was given, or some run is long enough."""
        return self.expectation.noise is not None or tells_noise(self.weight)

    def left(self, residual: Float[np.ndarray, "runs n"]) -> LackOfFit:
        """Return what weighted residuals hold, by the test that judges a comparison too."""
        rows, records = [], []
        for row, w, record in zip(residual, self.weight, self.records, strict=True):
            seen = w[w > 0]
            rows.append(row[w > 0] / seen / even(seen))
            records.append(record[w > 0] / even(seen))
        return self._of_separate_samples(
            what_is_left(rows, records, self.expectation, self._intervals), rows, records
        )

    def _of_separate_samples(self, left: LackOfFit, rows, records) -> LackOfFit:
        """Return the same, but for a pattern in flow curves and sweeps, which no noise has."""
        kinds = [run.protocol.control in STATES for run in self.resolution.runs]
        separate = [
            (row, rms(record) or 1.0)
            for row, record, kind in zip(rows, records, kinds, strict=True)
            if kind and len(row) >= FEWEST_FAST
        ]
        if left.verdict != "explained" or not separate:
            return left
        probability = separate_probability([row for row, _ in separate])
        pattern = float(np.mean([slow_part(row) / size for row, size in separate]))
        known = self.expectation.noise is not None and left.misfit <= left.expected
        if probability > SIGNIFICANCE or known:
            return left
        if replace(self.expectation, repeat_error=0.0).excuses(pattern):
            return left
        reason = f"what is left ({percent_of(left.misfit)}) has {PATTERN}"
        return replace(
            left, verdict="unexplained", probability=probability, reason=reason, pattern=PATTERN
        )

    def explained(self, fit: Fit, active: Sequence[str]) -> bool:
        """Return whether what a fit leaves is what a complete model may leave."""
        if self._explains(fit.residual) or self.unresolved(fit, active):
            return True
        corrected = self.resolution.corrected(fit, active)
        return corrected is not None and self._explains(corrected)

    def random(self, fit: Fit, active: Sequence[str]) -> bool:
        """Return whether what a fit leaves cannot be told from noise, but for arithmetic.

        Runs too short to be tested do not say that it is; see `noise_probability`.
        """
        if self._is_random(fit.residual) or self.unresolved(fit, active):
            return True
        corrected = self.resolution.corrected(fit, active)
        return corrected is not None and self._is_random(corrected)

    def _explains(self, residual: Float[np.ndarray, "runs n"]) -> bool:
        # what is too short to be tested does not say that something is missing
        return not self.noise_known or self.left(residual).verdict != "unexplained"

    def _is_random(self, residual: Float[np.ndarray, "runs n"]) -> bool:
        left = self.left(residual)
        # a few samples that noise does not reach are a misfit, whatever is left of the others
        if left.misfit > STRUCTURE * left.expected:
            return False
        return left.probability is not None and left.probability > SIGNIFICANCE
