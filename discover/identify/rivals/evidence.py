"""Can the data tell two fitted laws apart? Tests on residuals that are correlated in time."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float, Int
from scipy.stats import chi2, norm

Test = Literal["tie", "likelihood_ratio", "vuong"]

LEVEL = 0.05
"""Level of the tests: a law as good as the chosen one is ruled out in one case of twenty."""


@dataclass(frozen=True)
class Evidence:
    """How well the data tell a law from the chosen one.

    `told_apart`: whether the test rejects, at `LEVEL`, that the other law is as good.
    `test`: ``"tie"``: the predictions agree to integration error. ``"likelihood_ratio"``: one law
        is the other with a coefficient zero. ``"vuong"``: neither holds the other.
    `p_value`: probability of so large a disadvantage by chance; one for a tie.
    `effective_samples`: number of independent residuals, fewer than samples where residuals are
        correlated.
    """

    told_apart: bool
    test: Test
    p_value: float
    effective_samples: float


def compare_residuals(
    chosen: Float[np.ndarray, " rows"],
    other: Float[np.ndarray, " rows"],
    run_of_row: Int[np.ndarray, " rows"],
    nested: int = 0,
    floor: float = 0.0,
) -> Evidence:
    """Return whether the data tell another law from the chosen one.

    Vuong's test   [Vuong 1989, Econometrica 57, 307] asks whether the mean difference of squared
    residuals d = r_other² − r_chosen² exceeds zero by more than chance. Its standard error counts
    the correlation in time of d within each run (Newey & West 1987, Econometrica 55, 703, with the
    bandwidth n^(1/3)), and runs as independent. Where the other law is the chosen one with some
    coefficients zero, d has no normal limit; there n_eff ln(Σ r_other²/Σ r_chosen²) is compared
    with χ² of as many degrees of freedom, n_eff being the number of samples over the correlation
    time of the chosen law's residuals.

    `chosen`, `other`: weighted residuals of the two fitted laws, in the order of time within a run.
    `nested`: number of coefficients of the chosen law that the other lacks, if it is otherwise the
    same; 0 where neither holds the other. `floor`: norm of the difference of the two predictions
    that integration error may cause.
    """
    n = chosen.size
    samples = _effective_samples(chosen, run_of_row)
    if float(np.linalg.norm(other - chosen)) <= floor:
        return Evidence(False, "tie", 1.0, samples)
    difference = other**2 - chosen**2
    total = float(np.sum(difference))
    if nested:
        ratio = np.sum(other**2) / max(float(np.sum(chosen**2)), floor**2, 1e-300)
        p_value = float(chi2.sf(max(samples * np.log(ratio), 0.0), nested))
        return Evidence(p_value < LEVEL, "likelihood_ratio", p_value, samples)
    centred = difference - total / n
    variance = sum(_long_run_variance(centred[run_of_row == r]) for r in np.unique(run_of_row))
    p_value = float(norm.sf(total / np.sqrt(variance))) if variance > 0 else float(total <= 0)
    return Evidence(p_value < LEVEL, "vuong", p_value, samples)


def _lags(n: int) -> int:
    return max(1, min(n - 1, round(n ** (1.0 / 3.0)))) if n > 1 else 0


def _long_run_variance(series: Float[np.ndarray, " n"]) -> float:
    """Return the variance of the sum of a correlated series, with Bartlett's weights."""
    n = series.size
    lags = _lags(n)
    total = float(series @ series)
    for lag in range(1, lags + 1):
        weight = 1.0 - lag / (lags + 1.0)
        total += 2.0 * weight * float(series[lag:] @ series[:-lag])
    return max(total, 0.0)


def _effective_samples(
    residual: Float[np.ndarray, " rows"], run_of_row: Int[np.ndarray, " rows"]
) -> float:
    """Return the number of rows over the correlation time of the residuals, at most the number."""
    plain = float(residual @ residual)
    if plain == 0.0:
        return float(residual.size)
    long_run = sum(_long_run_variance(residual[run_of_row == r]) for r in np.unique(run_of_row))
    return residual.size * min(1.0, plain / max(long_run, 1e-300))
