"""What a residual is made of: noise, or structure."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class ResidualSummary:
    """Noise and structure in the residuals of some runs.

    Attributes
    ----------
    noise
        Relative noise of each run, from third differences of its residual.
    autocorrelation
        Correlation of neighbouring residuals of each run.
    effective_samples
        Number of independent samples that the residuals of all runs are worth.
    """

    noise: Float[np.ndarray, " runs"]
    autocorrelation: Float[np.ndarray, " runs"]
    effective_samples: float

    @property
    def noise_floor(self) -> float:
        """Mean over runs of the relative noise."""
        return float(np.mean(self.noise))


def summarise(
    residual: Float[np.ndarray, "runs n"], weight: Float[np.ndarray, "runs n"]
) -> ResidualSummary:
    """Return noise and structure of weighted residuals.

    The noise comes from third differences, which a smooth residual hardly has, through their
    median, which a few jumps hardly move   [Gasser, Sroka & Jennen-Steinmetz 1986, Biometrika 73,
    625, for the idea]. Samples correlated with their neighbours are worth
    n (1 − ρ)/(1 + ρ) independent ones.

    Parameters
    ----------
    residual
        Weighted residuals, padded.
    weight
        Their weights, zero at padding.
    """
    noise, correlation, effective = [], [], 0.0
    for row, w in zip(residual, weight, strict=True):
        values = row[w > 0] * np.sqrt(np.count_nonzero(w))
        n = len(values)
        third = np.diff(values, 3)
        # the coefficients 1, 3, 3, 1 have a sum of squares of 20
        noise.append(1.4826 * np.median(np.abs(third)) / np.sqrt(20.0) if n > 6 else 0.0)
        power = float(np.sum(values**2))
        rho = float(np.sum(values[1:] * values[:-1])) / power if power > 0 and n > 2 else 0.0
        rho = float(np.clip(rho, 0.0, 0.99))
        correlation.append(rho)
        effective += max(1.0, n * (1.0 - rho) / (1.0 + rho))
    return ResidualSummary(np.array(noise), np.array(correlation), effective)
