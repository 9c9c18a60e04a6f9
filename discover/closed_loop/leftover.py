"""What a fit leaves, held against what a complete model would leave."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from discover.closed_loop.least_squares import Fit
from discover.closed_loop.resolution import Resolution
from discover.statistics.residual import SIGNIFICANCE, STRUCTURE, Expectation, noise_probability


@dataclass(frozen=True)
class Leftover:
    """What a complete model may leave of some runs: noise, error of the linear data, arithmetic.

    Attributes
    ----------
    expectation
        Noise, and the error of the linear data.
    resolution
        What arithmetic leaves of these runs.
    """

    expectation: Expectation
    resolution: Resolution

    @property
    def weight(self) -> Float[np.ndarray, "runs n"]:
        """Weights of the runs, zero at padding."""
        return np.asarray(self.resolution.batch.weight)

    def on(self, resolution: Resolution) -> "Leftover":
        """Return the same expectation of other runs."""
        return Leftover(self.expectation, resolution)

    def unresolved(self, fit: Fit, active: Sequence[str]) -> bool:
        """Return whether what a fit leaves is no more than arithmetic leaves."""
        error = self.resolution.mean(fit.run_errors)
        return error <= STRUCTURE * self.resolution.limit(fit.theta, active, error)

    def explained(self, fit: Fit, active: Sequence[str]) -> bool:
        """Return whether what a fit leaves is what a complete model may leave."""
        if self.expectation.explains(fit.residual, self.weight) or self.unresolved(fit, active):
            return True
        corrected = self.resolution.corrected(fit, active)
        return corrected is not None and self.expectation.explains(corrected, self.weight)

    def random(self, fit: Fit, active: Sequence[str]) -> bool:
        """Return whether what a fit leaves cannot be told from noise, but for arithmetic.

        Runs too short to be tested do not say that it is; see `noise_probability`.
        """
        if self._is_random(fit.residual) or self.unresolved(fit, active):
            return True
        corrected = self.resolution.corrected(fit, active)
        return corrected is not None and self._is_random(corrected)

    def _is_random(self, residual: Float[np.ndarray, "runs n"]) -> bool:
        probability = noise_probability(residual, self.weight)
        return probability is not None and probability > SIGNIFICANCE
