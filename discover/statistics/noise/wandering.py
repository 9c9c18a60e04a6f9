"""Does a residual wander as a random walk does? What a zero that drifts at random leaves.

A law that is not quite right leaves a smooth misfit, which comes to rest where the stress does. A
zero that wanders never rests, and its steps are small and independent.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from discover.statistics.noise.whiteness import FEWEST_TESTED
from discover.statistics.noise.whittle import cosine_power, smooth, spectra, whittle_likelihood

_SHARES = np.append(0.0, np.geomspace(1e-3, 1e5, 60))  # of the slow part, over the noise's
_CLEAR = 2.0
"""Gain in log likelihood over a smooth misfit from which on a row is said to wander."""

_AFTER_START = 3  # a third of a run, in which a misfit of a start has come to rest


def wandering(rows: Sequence[Float[np.ndarray, " _"]]) -> float | None:
    """Return how far rows wander, root-mean-square at the end of one; None where they do not.

    White noise with a random walk beside it, the same in all rows, is held against white noise
    with a smooth misfit, whose size each row has of its own, by Whittle's likelihood in the cosine
    transform: the spectrum of the one is 1/(4 sin²(πk/2n)), that of the other 1/(1 + (k/k₀)⁴)
    [Whittle 1953, Ark. Mat. 2, 423]. The walk must be likelier by a factor of e² along whole rows
    and without their first third too, since what a wrong start leaves falls off like a walk.

    `rows`: residuals of each run, in order, in a unit in which runs compare.
    """
    long = [np.asarray(row, dtype=float) for row in rows if len(row) >= 2 * FEWEST_TESTED]
    long = [row for row in long if np.any(row)]
    if not long:
        return None
    gain, share = _gain(long)
    after_start, _ = _gain([row[len(row) // _AFTER_START :] for row in long])
    if gain < _CLEAR or after_start < 0.5 * _CLEAR:
        return None
    level = [np.mean(cosine_power(row) / (1.0 + share * _walk(len(row)))) for row in long]
    return float(np.sqrt(share * np.mean([n * len(r) for n, r in zip(level, long, strict=True)])))


def _gain(rows: Sequence[np.ndarray]) -> tuple[float, float]:
    """Return how much likelier a walk is than a smooth misfit, and its share, in logarithms."""
    walk, slow = 0.0, 0.0
    for row in rows:
        power, n = cosine_power(row), len(row)
        tried = spectra(1.0 + _SHARES[:, None] * _walk(n))
        walk = walk + whittle_likelihood(power, tried)
        tried = spectra(1.0 + _SHARES[:, None, None] * smooth(np.arange(1, n)))
        slow = slow + np.max(whittle_likelihood(power, tried), axis=0)
    return float(np.max(walk) - np.max(slow)), float(_SHARES[int(np.argmax(walk))])


def _walk(n: int) -> np.ndarray:
    return 0.25 / np.sin(0.5 * np.pi * np.arange(1, n) / n) ** 2
