"""Tests of residuals for noise: a smooth misfit, and neighbours that agree.

First-order noise falls off gradually in frequency; a smooth misfit stands on a floor.
"""

from collections.abc import Sequence
from functools import lru_cache
from math import comb

import numpy as np
from jaxtyping import Float
from scipy.fft import dct
from scipy.special import gammaincc

from discover.statistics.noise_model import Rows, first_order, rms

FEWEST_TESTED = 24
"""Samples of a run from which on its noise can be told from a smooth misfit."""

FEWEST_FAST = 7
"""Samples of a run from which on its noise can be told by third differences."""

_HALF_SWINGS = np.array([1.0, 2.0, 4.0, 8.0])
"""Of a smooth misfit along a run, as they are tried."""

_CORRELATIONS = np.linspace(0.0, 0.9, 10)  # of neighbouring samples, as they are tried
_SHARES = np.append(0.0, np.geomspace(0.3, 300.0, 10))  # of the slowest, over the noise's variance
_DRAWS = 200
_PLAIN = 2.0  # gain in log likelihood below which nothing needs to be drawn
_NEAREST, _LOTS = 3, 4000


def smooth_misfit_probability(rows: Sequence[Float[np.ndarray, " _"]]) -> float:
    """Return the probability of so clear a smooth part of these rows, if they are noise.

    Likelihood of first-order noise, with a size for each run, against the same with a smooth part,
    whose spectrum falls as 1/(1 + (k/k₀)⁴), in the cosine transform [after Whittle 1953, Ark. Mat.
    2, 423; Ahmed, Natarajan & Rao 1974, IEEE Trans. Comput. 23, 90]; by the wild bootstrap (signs
    drawn with a fixed seed) on the innovations [Liu 1988, Ann. Stat. 16, 1696] with a gamma
    distribution. `rows`: residuals of each run.
    """
    gain, rho = _gain([row[None] for row in rows])
    if gain[0] < _PLAIN:
        return 1.0
    return _exceeded(gain[0], _gain(_redrawn(rows, rho[0]))[0])


def _redrawn(
    rows: Sequence[Float[np.ndarray, " _"]], rho: float
) -> list[Float[np.ndarray, "draws _"]]:
    """Return draws of each row: first-order noise, the signs of whose innovations are drawn."""
    generator, drawn = np.random.default_rng(0), []
    for row in rows:
        new = row - rho * np.append(0.0, row[:-1])
        signs = generator.choice([-1.0, 1.0], (_DRAWS, len(row)))
        drawn.append(first_order(np.full(len(row), rho), (signs * new).T).T)
    return drawn


def _exceeded(value: float, by_chance: Float[np.ndarray, " draws"]) -> float:
    """Return the probability of so large a value, by a gamma distribution of draws."""
    mean, variance = float(np.mean(by_chance)), float(np.var(by_chance))
    if variance <= 0.0:
        return 1.0
    return float(gammaincc(mean**2 / variance, value * mean / variance))


def _gain(stacks: Sequence[Float[np.ndarray, "draws _"]]):
    """Return what a smooth part adds to the log likelihood, and the correlation without it."""
    alone, beside = 0.0, 0.0
    for rows in stacks:
        n = rows.shape[-1]
        inverse, normalised = _spectra(n)
        power = np.square(np.asarray(dct(rows, type=2, norm="ortho")))
        level = np.maximum(power @ inverse / n, 1e-300)
        likelihood = (-0.5 * n * np.log(level) - normalised).reshape(
            -1, len(_CORRELATIONS), len(_HALF_SWINGS), len(_SHARES)
        )
        alone = alone + likelihood[..., 0, 0]
        beside = beside + np.max(likelihood, axis=-1)
    gain = np.max(beside, axis=(1, 2)) - np.max(alone, axis=1)
    return gain, _CORRELATIONS[np.argmax(alone, axis=1)]


@lru_cache(maxsize=16)
def _spectra(n: int):
    """Return one over every spectrum that is tried, shape (n, tried), and half its log, summed."""
    k, rho = np.arange(n), _CORRELATIONS[:, None]
    noise = (1.0 - rho**2) / (1.0 - 2.0 * rho * np.cos(np.pi * k / n) + rho**2)
    smooth = 1.0 / (1.0 + (k / _HALF_SWINGS[:, None]) ** 4)
    spectra = (noise[:, None, None] + _SHARES[:, None] * smooth[:, None, :]).reshape(-1, n)
    return (1.0 / spectra).T, 0.5 * np.sum(np.log(spectra), axis=1)


def independence_probability(rows: Sequence[Float[np.ndarray, " _"]]) -> float:
    """Return the probability of neighbours that agree so much, if each sample is separate.

    Points of a flow curve or sweep are experiments of their own, without correlated noise. Products
    of the nearest neighbours against the same numbers with signs drawn with a fixed seed [Liu 1988,
    Ann. Stat. 16, 1696]. `rows`: residuals of each series in the order of its rates.
    """
    generator = np.random.default_rng(0)
    own, drawn = 0.0, np.zeros(_LOTS)
    for values in rows:
        row = values / (1.4826 * float(np.median(np.abs(values))) or rms(values) or 1.0)
        lots = generator.choice([-1.0, 1.0], (_LOTS, len(row))) * row
        for lag in range(1, (_NEAREST if len(row) >= FEWEST_TESTED else 1) + 1):
            own += float(row[lag:] @ row[:-lag])
            drawn += np.einsum("dt,dt->d", lots[:, lag:], lots[:, :-lag])
    return float((1 + np.count_nonzero(drawn >= own)) / (1 + _LOTS))


def sample_to_sample_noise(values: Float[np.ndarray, " n"]) -> float:
    """Return the standard deviation of what changes from sample to sample.

    From the median of third differences, which smooth sequences and a few jumps hardly change
    [Gasser, Sroka & Jennen-Steinmetz 1986, Biometrika 73, 625]. Zero for fewer than `FEWEST_FAST`.
    """
    if len(values) < FEWEST_FAST:
        return 0.0
    return float(1.4826 * np.median(np.abs(np.diff(values, 3))) / np.sqrt(comb(6, 3)))


def fast_noise(rows: Rows, sizes: Float[np.ndarray, " runs"]) -> Float[np.ndarray, " runs"]:
    """Return the noise of runs in a residual that is more than noise: what of it is fast.

    `sizes`: the most it may be, as that of a run too short to tell is.
    """
    told = [len(row) >= FEWEST_FAST for row in rows]
    return np.where(told, np.minimum([sample_to_sample_noise(row) for row in rows], sizes), sizes)
