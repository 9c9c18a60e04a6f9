"""Noise of records: a size for each run, correlated in time, in proportion to the stress or not.

The residual of a sample over its standard deviation is an AR(1) sequence in each run. The size of
run r is s_r = a · rms, with 1/s_r² gamma distributed about one a of all runs, so that runs share
what they can and a loud one speaks softly; it is integrated out   [Gelman et al. 2013, Bayesian
Data Analysis, ch. 5 and 14]. The correlation and the share of noise in proportion to the stress are
summed over a grid.
"""

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.optimize import minimize_scalar
from scipy.special import gammaln

from discover.inference.rows import Rows

CORRELATIONS = (0.0, 0.25, 0.45, 0.6, 0.75, 0.88, 0.95)
SHARES = (0.0, 0.6, 0.9, 0.985)
"""Of the variance, what is in proportion to the square of the stress."""

_ALIKE = 4.0
"""Degrees of freedom by which sizes of runs are alike: two of three within a factor of 1.5."""

_KNOWN = 100.0
"""The same where the noise is known: within a tenth."""

STATED_TOO_SMALL = 1.3
"""What a law leaves that is all there is, over the noise as stated, from which on that is none."""

LEAST = 3e-4
"""Size over the record of independent noise that is always there: what a model of a fluid is not
told to. Records without noise differ from any integration by as much."""

_FAR = 1e6
"""Of a record, from which on a residual is none."""

_BLOCK = 16
"""Variances whose logarithms are taken together: each is less than `_FAR` to the third."""

_SHARES = np.array(SHARES)

_GRID = tuple(product(range(len(SHARES)), range(len(CORRELATIONS))))


def _prior(count: int) -> np.ndarray:
    """Return the log probability of each value: the first, which is none, as that of the others."""
    return np.log(np.where(np.arange(count) == 0, 0.5, 0.5 / (count - 1)))


_PRIORS = (_prior(len(SHARES))[:, None] + _prior(len(CORRELATIONS))).ravel()


@dataclass(frozen=True)
class Noise:
    """One noise: sizes of runs over their records, correlation, share in proportion."""

    sizes: Float[np.ndarray, " runs"]
    common: float
    correlation: float
    share: float


def deviation(
    size: Float[np.ndarray, " rows"], predicted: Float[np.ndarray, " rows"], share: float
) -> Float[np.ndarray, " rows"]:
    """Return the standard deviation of rows over the size of the noise of their run, in Pa.

    `size`: of each record. `share`: of the variance that goes as the square of the stress.
    """
    return size * np.sqrt(1.0 - share + share * (predicted / size) ** 2)


class NoiseModel:
    """The likelihood of residuals of rows, with noise integrated out.

    `rows`: the records. `without`: a run that is left out; None for none. `known`: size over the
    records, where it is known.
    """

    def __init__(self, rows: Rows, without: int | None = None, known: float | None = None):
        self.rows, self.known = rows, known
        self._alike = _ALIKE if known is None else _KNOWN
        self.kept = np.flatnonzero(rows.run != without)
        self._run, self._gap = rows.run[self.kept], rows.gap[self.kept]
        self._size = rows.size[self.kept]
        self._log_size = float(np.sum(np.log(self._size)))
        self._before = np.maximum(np.arange(len(self.kept)) - 1, 0)
        self._blocks = np.arange(0, len(self.kept), _BLOCK)
        self._count = np.bincount(self._run, minlength=len(rows.runs)).astype(float)
        self._there = np.flatnonzero(self._count)
        half = 0.5 * self._alike
        self._gammas = float(np.sum(gammaln(half + 0.5 * self._count) - gammaln(half)))
        self._starts = np.searchsorted(self._run, self._there)
        # samples of one run as far from the one before decay alike
        order = np.lexsort((self._gap, self._run))
        run, gap = self._run[order], self._gap[order]
        self._order = order if np.any(np.diff(order) != 1) else None
        new = np.append(True, (np.diff(run) != 0) | (np.diff(gap) != 0)) if len(run) else []
        self._groups = np.flatnonzero(new)
        self._group_starts = np.searchsorted(run[self._groups], self._there)
        decay = np.array([self._decay(c) for c in CORRELATIONS])
        self._determinants = -0.5 * np.sum(np.log(1.0 - decay**2), axis=1)
        self._decays = decay[:, order[self._groups]]

    def _decay(self, correlation: float) -> Float[np.ndarray, " rows"]:
        return np.where(self._gap > 0, correlation ** np.maximum(self._gap, 1), 0.0)

    def log_determinant(self, predicted: Float[np.ndarray, " rows"], noise: Noise) -> float:
        """Return the log determinant of what `whitened` multiplies by."""
        decay, scale = self._decay(noise.correlation), self._scale(predicted, noise)
        return float(-0.5 * np.sum(np.log(1.0 - decay**2)) - np.sum(np.log(scale)))

    def _scale(self, predicted: Float[np.ndarray, " rows"], noise: Noise):
        """Return the standard deviation of each row that is kept, in Pa."""
        of_size_one = deviation(self._size, predicted[self.kept], noise.share)
        return of_size_one * noise.sizes[self._run]

    def log_likelihood(
        self, residual: Float[np.ndarray, " rows"], predicted: Float[np.ndarray, " rows"]
    ) -> tuple[float, Noise]:
        """Return the log likelihood over all noises, and the likeliest noise."""
        values, noises = self.log_likelihoods(residual[None], predicted[None])
        return float(values[0]), noises[0]

    def log_likelihoods(
        self,
        residual: Float[np.ndarray, "trials rows"],
        predicted: Float[np.ndarray, "trials rows"],
    ) -> tuple[Float[np.ndarray, " trials"], list[Noise]]:
        """Return the log likelihood of each trial over all noises, and its likeliest noise.

        Minus infinity, where a residual is not finite or far beyond its record.
        """
        runs = len(self._count)
        values = np.full(len(residual), -np.inf)
        noises = [Noise(np.ones(runs), 1.0, 0.0, 0.0)] * len(residual)
        off = residual / self.rows.size
        # a number that is none compares as false
        usable = np.flatnonzero(np.max(np.abs(off), axis=1) < _FAR)
        if not len(usable):
            return values, noises
        off = off[usable][:, None, self.kept]
        relative = (predicted[usable][:, None, self.kept] / self._size) ** 2
        variance = 1.0 + _SHARES[:, None] * (relative - 1.0)
        over = 1.0 / variance
        # independent noise is a large one where it is taken for correlated or in proportion
        own = (off**2 + LEAST**2) * over
        # of the first there is none before, which its decay of zero says
        lagged = np.zeros_like(own)
        lagged[..., 1:] = off[..., 1:] * off[..., :-1] * np.sqrt(over[..., 1:] * over[..., :-1])
        parts = [own, own[..., self._before], lagged]
        if self._order is not None:
            parts = [part[..., self._order] for part in parts]
        sums = [np.add.reduceat(part, self._groups, axis=-1)[..., None, :] for part in parts]
        decay = self._decays
        left = (sums[0] + decay**2 * sums[1] - 2.0 * decay * sums[2]) / (1.0 - decay**2)
        square = np.zeros((len(usable), len(SHARES), len(CORRELATIONS), runs))
        square[..., self._there] = np.add.reduceat(left, self._group_starts, axis=-1)
        square = square.reshape(len(usable), len(_GRID), runs)
        # a logarithm of many together: none leaves the range of numbers
        together = np.multiply.reduceat(variance, self._blocks, axis=-1)
        spreads = self._log_size + 0.5 * np.sum(np.log(together), axis=-1)
        densities, common = self._marginal(square)
        densities += (self._determinants - spreads[..., None]).reshape(len(usable), -1) + _PRIORS
        values[usable] = np.logaddexp.reduce(densities, axis=1)
        for one, at, best in zip(usable, range(len(usable)), np.argmax(densities, 1), strict=True):
            share, correlation = _GRID[best]
            size, known = common[at, best], self._alike + self._count
            noises[one] = Noise(
                np.sqrt((self._alike * size + square[at, best]) / known),
                float(np.sqrt(size)),
                CORRELATIONS[correlation],
                SHARES[share],
            )
        return values, noises

    def refined(
        self,
        residual: Float[np.ndarray, " rows"],
        predicted: Float[np.ndarray, " rows"],
        noise: Noise,
    ) -> Noise:
        """Return a noise of the grid with the likeliest correlation between its neighbours there.

        A grid is fine enough to sum over, but not for an interval: at a correlation of 0.9 the
        nearest value makes it a fifth too narrow.
        """
        at = CORRELATIONS.index(noise.correlation)
        if at == 0:
            return noise
        of_size_one = deviation(self._size, predicted[self.kept], noise.share)
        scaled = residual[self.kept] / of_size_one
        own = (LEAST * self._size / of_size_one) ** 2

        def of(correlation: float):
            decay = self._decay(correlation)
            left = (scaled - decay * scaled[self._before]) ** 2 + own + decay**2 * own[self._before]
            square = np.zeros(len(self._count))
            square[self._there] = np.add.reduceat(left / (1.0 - decay**2), self._starts)
            value, common = self._marginal(square[None])
            return value[0] - 0.5 * np.sum(np.log(1.0 - decay**2)), common[0], square

        ends = CORRELATIONS[at - 1], CORRELATIONS[min(at + 1, len(CORRELATIONS) - 1)]
        found: Any = minimize_scalar(
            lambda c: -of(c)[0], bounds=ends, method="bounded", options={"xatol": 1e-3}
        )
        correlation = float(found.x)
        _, common, square = of(correlation)
        sizes = np.sqrt((self._alike * common + square) / (self._alike + self._count))
        return Noise(sizes, float(np.sqrt(common)), correlation, noise.share)

    def _marginal(self, square: Float[np.ndarray, "*grid runs"]):
        """Return the log density with sizes of runs integrated out, and the likeliest a²."""
        counts, total = self._alike + self._count, float(np.sum(self._count))
        common = np.sum(square, axis=-1) / total
        if self.known is not None:
            common = np.full_like(common, max(self.known, LEAST) ** 2)
        for _ in range(6 if self.known is None else 0):
            common = len(counts) / ((1.0 / (self._alike * common[..., None] + square)) @ counts)
        alike = self._alike * common
        density = self._gammas - 0.5 * total * np.log(np.pi)
        density += 0.5 * self._alike * len(counts) * np.log(alike)
        return density - 0.5 * np.log(alike[..., None] + square) @ counts, common

    def least(self, predicted: Float[np.ndarray, " rows"], noise: Noise) -> float:
        """Return the sum of squares that `whitened` makes of the independent noise `LEAST`."""
        own = (LEAST * self._size / self._scale(predicted, noise)) ** 2
        decay = self._decay(noise.correlation) ** 2
        return float(np.sum((own + decay * own[self._before]) / (1.0 - decay)))

    def whitened(
        self,
        values: Float[np.ndarray, "rows k"],
        predicted: Float[np.ndarray, " rows"],
        noise: Noise,
    ) -> Float[np.ndarray, "kept k"]:
        """Return columns of the rows that are kept, over independent noise of variance one."""
        scaled = values[self.kept] / self._scale(predicted, noise)[:, None]
        decay = self._decay(noise.correlation)[:, None]  # zero at the first of a run
        scaled[1:] -= decay[1:] * scaled[:-1]
        scaled /= np.sqrt(1.0 - decay**2)
        return scaled
