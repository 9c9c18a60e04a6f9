"""Samples that stand out at the same place of several runs, alike: no noise, and no knocks."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import median_filter
from scipy.stats import t as student

_STANDS_OUT = 6.0  # robust standard deviations of the neighbourhood
_SAME_PLACE_BESIDE, _SAME_PLACE_NEIGHBOURHOOD = 5, 25
_SAME_PLACE_REPEATED = 1e-3
"""Probability below which samples at one place are no chance."""


def same_place_probability(rows: Sequence[Float[np.ndarray, " _"]]) -> float:
    """Return how probable samples are that stand out so alike at one place of several runs.

    Noise may be louder at a place than elsewhere, but of one run it knows nothing of another's: its
    mean over the runs is zero, within the spread of the runs there   [Student 1908, Biometrika 6,
    1]. The first and the last place, where an imperfect start or end shows, count for half of the
    places asked.

    `rows`: residuals of each run, in order, in a unit in which runs compare.
    """
    return float(min((probability for _, probability in _places(rows)), default=1.0))


def repeated(rows: Sequence[Float[np.ndarray, " _"]]) -> list[int]:
    """Return the places at which samples stand out in several runs alike; −1 is the last."""
    return [at for at, probability in _places(rows) if probability <= _SAME_PLACE_REPEATED]


def _places(rows: Sequence[Float[np.ndarray, " _"]]) -> list[tuple[int, float]]:
    """Return where samples of two runs or more stand out, and how probable it is that they do."""
    length = min(map(len, rows), default=0)
    if len(rows) < 2 or length < _SAME_PLACE_BESIDE:
        return []
    out = [_standing_out(np.asarray(row, dtype=float)) for row in rows]
    found = []
    for at in [*range(length), -1]:
        if sum(bool(loud[at]) for loud in out) < 2:
            continue
        values = np.array([row[at] for row in rows])
        error = float(np.std(values, ddof=1)) / np.sqrt(len(values))
        ratio = abs(float(np.mean(values))) / max(error, np.finfo(float).tiny)
        tried = 2 * (2 if at in (0, -1) else length)
        found.append((at, min(1.0, tried * 2.0 * float(student.sf(ratio, len(values) - 1)))))
    return found


def _standing_out(row: Float[np.ndarray, " n"]) -> Bool[np.ndarray, " n"]:
    """Return which samples differ from the median around them by far more than their neighbours.

    So neither a smooth misfit nor a loud stretch stands out; the first and the last sample may.
    """
    apart = np.abs(row - median_filter(row, _SAME_PLACE_BESIDE, mode="reflect"))
    size = min(_SAME_PLACE_NEIGHBOURHOOD, len(row))
    spread = 1.4826 * median_filter(apart, size, mode="reflect")
    return apart > _STANDS_OUT * spread
