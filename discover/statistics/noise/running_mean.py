"""Is a residual noise of which each sample is a mean? What an instrument leaves that smooths.

A running mean takes away certain frequencies altogether, which neither correlated noise nor what a
law lacks does.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from jaxtyping import Float

from discover.statistics.noise.whiteness import FEWEST_TESTED
from discover.statistics.noise.whittle import (
    Spectra,
    correlated,
    cosine_power,
    smooth,
    spectra,
    whittle_likelihood,
)

_WIDTHS = np.arange(2, 31)  # samples, of a running mean
_FLOORS = np.geomspace(1e-4, 0.3, 6)  # of noise that comes after the filter, over that before it
_CORRELATIONS = np.linspace(0.0, 0.95, 12)
_SHARES = np.append(0.0, np.geomspace(1e-3, 1e5, 40))  # of the slow part, over the noise's variance
_CLEAR = 8.0
"""Gain in log likelihood over correlated noise with a smooth misfit from which on rows are said to
be means. Of 750 sets of one to six rows that are none, misfits of four shapes in white and in
correlated noise, none gains as much."""
_SLOWEST = 6.0  # widths in a run: a mean over more leaves what is as slow as a misfit


def averaged_over(rows: Sequence[Float[np.ndarray, " _"]]) -> int | None:
    """Return over how many samples noise was averaged that leaves such rows; None if it was not.

    White noise behind a running mean, with less of it beside, is held against noise with a
    first-order correlation and a smooth misfit, whose size each row has of its own, by Whittle's
    likelihood in the cosine transform   [Whittle 1953, Ark. Mat. 2, 423].

    `rows`: residuals of each run, in order, in any unit; those of fewer than 48 samples say
    nothing.
    """
    long = [np.asarray(row, dtype=float) for row in rows if len(row) >= 2 * FEWEST_TESTED]
    long = [row for row in long if np.any(row)]
    if not long:
        return None
    means, misfit = 0.0, 0.0
    for row in long:
        power = cosine_power(row)
        means = means + whittle_likelihood(power, _means(len(row)))
        each = whittle_likelihood(power, _correlated(len(row)))
        misfit = misfit + np.max(each, axis=-1)  # a smooth part of its own
    gain = np.max(means, axis=1) - np.max(misfit)
    widest = min(map(len, long)) / _SLOWEST
    gain[widest < _WIDTHS] = -np.inf
    best = int(np.argmax(gain))
    return int(_WIDTHS[best]) if gain[best] > _CLEAR else None


@lru_cache(maxsize=8)
def _means(n: int) -> Spectra:
    """Return spectra of white noise behind running means with less beside, (widths, floors)."""
    angle, width = np.pi * np.arange(1, n) / n, _WIDTHS[:, None]
    mean = (np.sin(0.5 * width * angle) / (width * np.sin(0.5 * angle))) ** 2
    return spectra(mean[:, None] + _FLOORS[:, None])


@lru_cache(maxsize=8)
def _correlated(n: int) -> Spectra:
    """Return spectra of correlated noise with smooth misfits, (swings, correlations, sizes)."""
    k = np.arange(1, n)
    noise = correlated(_CORRELATIONS, np.pi * k / n)
    return spectra(noise[None, :, None] + _SHARES[:, None] * smooth(k)[:, None, None])
