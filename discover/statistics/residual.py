"""What a residual is made of: noise, or structure.

Rows are residuals of runs over the root mean square of each record.
"""

from dataclasses import dataclass
from math import comb

import numpy as np
from jaxtyping import Float
from scipy.ndimage import median_filter

from discover.statistics.noise import whiteness
from discover.statistics.noise.noise_model import Rows, rms


def lag_one_correlation(row: Float[np.ndarray, " n"]) -> float:
    """Return the correlation of neighbours, from 0 to 0.99; 0 of fewer than three samples."""
    power = float(np.sum(row**2))
    rho = float(np.sum(row[1:] * row[:-1])) / power if power > 0 and len(row) > 2 else 0.0
    return float(np.clip(rho, 0.0, 0.99))


def fast_part(values: Float[np.ndarray, " n"]) -> float:
    """Return the standard deviation of what changes from sample to sample.

    From the median of third differences, which smooth sequences and a few jumps hardly change
    [Gasser, Sroka & Jennen-Steinmetz 1986, Biometrika 73, 625]. Zero for fewer than `FEWEST_FAST`.
    """
    if len(values) < whiteness.FEWEST_FAST:
        return 0.0
    return _median_difference([values], 3)


def slow_part(values: Float[np.ndarray, " n"]) -> float:
    """Return the root-mean-square of what does not change from sample to sample.

    At least that of means over a few samples: the difference to `fast_part` alone is zero where
    that is too large, by a tenth of 80 samples.
    """
    values = np.asarray(values, dtype=float)
    fast = fast_part(values)
    power = float(np.mean(values**2)) - fast**2
    whole = len(values) // _BLOCK
    if whole >= _FEWEST_BLOCKS:
        means = np.mean(values[: whole * _BLOCK].reshape(whole, _BLOCK), axis=1)
        power = max(power, float(np.mean(means**2)) - fast**2 / _BLOCK)
    return float(np.sqrt(max(power, 0.0)))


def _median_difference(rows: Rows, order: int) -> float:
    """Return the standard deviation of white noise with these differences, by their median."""
    differences = np.concatenate([np.diff(row, order) for row in rows])
    return float(1.4826 * np.median(np.abs(differences)) / np.sqrt(comb(2 * order, order)))


def noise_floor(rows: Rows, probability: float | None) -> float:
    """Return the relative noise, mean over runs.

    The size of a residual that is noise (single samples count up to six times the noise), else the
    part that changes from sample to sample; correlated noise is then underestimated. Runs too short
    to be tested are as noisy as the others, or as what changes in them if that is more; where all
    are, the noise is the same in all, from fourth differences. `probability`: by
    `noise_probability`.
    """
    fast, samples = np.array(list(map(fast_part, rows))), np.array(list(map(len, rows)))
    tested = samples >= whiteness.FEWEST_TESTED
    known = probability is not None and probability > whiteness.SIGNIFICANCE
    if not known and not np.any(tested) and np.all(samples >= whiteness.FEWEST_FAST):
        return _median_difference(rows, 4)
    if not known and probability is not None:
        return float(np.mean(fast))
    sizes = np.array(list(map(_limited_size, rows)))
    if np.any(tested):
        sizes = np.where(tested, sizes, np.maximum(fast, np.mean(sizes[tested])))
    return float(np.mean(sizes))


def _limited_size(row: Float[np.ndarray, " n"]) -> float:
    """Return the root mean square, each value limited to so many robust deviations beside it.

    A loud stretch counts in full; up to three samples are no stretch, two at an end.
    """
    if len(row) < whiteness.FEWEST_FAST:
        return rms(row)
    beside = 1.4826 * median_filter(np.abs(row), whiteness.FEWEST_FAST, mode="mirror")
    return rms(np.clip(row, -_LARGEST * beside, _LARGEST * beside))


_BLOCK, _FEWEST_BLOCKS = 8, 3
_LARGEST = 6.0  # robust standard deviations up to which one sample counts as noise

STRUCTURE = 1.5
"""A residual this many times larger than noise and linear error together is not explained."""


@dataclass(frozen=True)
class Expectation:
    """Error budget of a data set: what a complete model may leave.

    `repeat_error`: relative difference of repeated runs, noise and loading; 0 without any.
    """

    noise: float | None = None  # relative noise, where it is known
    linear_error: float = 0.0  # relative error of the linear data that the declared modes come from
    repeat_error: float = 0.0

    def explains(self, rows: Rows, probability: float | None, floor: float) -> bool:
        """Return whether noise and the error of the linear data explain a residual.

        It may be no larger than both together. A pattern that noise has not may be no larger than
        the error of the linear data or of repeats; or the whole no larger than a given noise.
        `probability`: by `noise_probability`. `floor`: relative noise.
        """
        error = float(np.mean(list(map(rms, rows))))
        if error > STRUCTURE * float(np.hypot(max(floor, self.repeat_error), self.linear_error)):
            return False
        if probability is None or probability > whiteness.SIGNIFICANCE:
            return True
        if self.noise is not None:
            return error <= float(np.hypot(self.noise, self.linear_error))
        # a pattern may be due to the sweep or to loadings
        excused = float(np.hypot(STRUCTURE * self.linear_error, self.repeat_error))
        return excused > 0.0 and float(np.mean(list(map(slow_part, rows)))) <= excused
