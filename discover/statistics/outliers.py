"""Outliers of records."""

import numpy as np
from jaxtyping import Bool, Float

_WIDEST = 2  # samples side by side that may be off together
_BESIDE = 3  # samples on either side by which they are judged
_ABOVE_NOISE = 6.0
"""Robust standard deviations of the noise. Three extrapolations must be missed by so much, to one
side: of Gaussian noise one sample in more than ten thousand does."""
_ABOVE_BENDS = 2.0
"""Times the sharpest bend of what remains: a real peak, or step, leaves a record that is bent."""
_BENDS_BEFORE = 8  # samples whose bends are compared with what stands apart near an end
_MOST_DROPPED = 0.2  # of the samples of a record
_NEIGHBOURHOOD = 31
_PASSES = 5


def isolated_outliers(record: Float[np.ndarray, " n"]) -> Bool[np.ndarray, " n"]:
    """Return which samples of a record are outliers: off the record before and after them.

    One or two samples are outliers if extrapolation from before, from after, and interpolation all
    miss to one side by far more than the noise around (third differences) [after Hampel 1974, J.
    Am. Stat. Assoc. 69, 383] and than the record bends: no peak, step or loud stretch. Of the last
    three samples, the second and third, one alone counts if twice as far off; the first never.
    Samples of exactly zero are held against those that are not.
    """
    values = np.asarray(record, dtype=float)
    off = _apart_near_ends(values) | _dropped(values)
    for _ in range(_PASSES):  # asked again of what remains
        left = np.flatnonzero(~off)
        if len(left) < 2 * _BESIDE + _WIDEST:
            break
        found = [_apart(values[left], width) for width in range(1, _WIDEST + 1)]
        off[left] = np.any(found, axis=0)
        if not np.any(off[left]):
            break
    return off


def _apart(values: Float[np.ndarray, " n"], width: int) -> Bool[np.ndarray, " n"]:
    """Return which groups of so many samples stand apart from those around them."""
    start, excess, beside = _excess(values, width)
    bends = np.max(np.abs(np.diff(beside, 2, axis=0)), axis=0)
    noise = _local_noise(values)[start]
    apart = np.abs(excess) > np.maximum(_ABOVE_NOISE * noise, _ABOVE_BENDS * bends)
    # of neighbours the larger is taken first; the others are asked again without it
    best = np.where(apart, np.abs(excess), -np.inf)
    around = np.array([np.roll(best, k) for k in range(-_BESIDE, _BESIDE + 1)])
    chosen = start[apart & (best >= np.max(around, axis=0))]
    off = np.zeros(len(values), dtype=bool)
    for i in range(width):
        off[chosen + i] = True
    return off


def _apart_near_ends(values: Float[np.ndarray, " n"]) -> Bool[np.ndarray, " n"]:
    """Return which single samples near an end stand apart: the second, third and last three."""
    off = np.zeros(len(values), dtype=bool)
    if len(values) < _NEIGHBOURHOOD:
        return off
    noise = _local_noise(values)
    for turned, nearest in ((slice(None), 0), (slice(None, None, -1), 1)):
        toward, quiet, found = values[turned], noise[turned], off[turned]
        # from the inside: what is beside a knock is off the line through it
        for beyond in range(_BESIDE - 1, nearest - 1, -1):  # samples from here to the end
            at = len(values) - 1 - beyond
            before, after = toward[at - _BENDS_BEFORE : at], toward[at + 1 :]
            found[at] = _is_apart(before, toward[at], after, quiet[at])
            if found[at]:
                break
    return off


def _dropped(values: Float[np.ndarray, " n"]) -> Bool[np.ndarray, " n"]:
    """Return which samples read zero though those around them do not, for want of a reading.

    Each is judged as if it were the only one, for several hide one another.
    """
    zero = values == 0.0
    off = np.zeros(len(values), dtype=bool)
    if np.count_nonzero(zero) > _MOST_DROPPED * len(values):
        return off  # of a record that rests, or has few values
    for at in np.flatnonzero(zero):
        kept = np.flatnonzero(~zero | (np.arange(len(values)) == at))
        own = int(np.searchsorted(kept, at))
        alone = values[kept]
        off[at] = _apart(alone, 1)[own] or _apart_near_ends(alone)[own]
    return off


def _is_apart(
    before: Float[np.ndarray, " n"], own: float, after: Float[np.ndarray, " m"], noise: float
) -> bool:
    """Return whether a sample near an end is off those beside it; not what settles or gives way."""
    one, two, three = before[-1], before[-2], before[-3]
    missed = [own - 2.0 * one + two, own - 3.0 * (one - two) - three]  # a line, and a parabola
    bends = np.abs(np.diff(before, 2))
    if len(after):
        missed.append(own - 0.5 * (one + after[0]))
        # the bend across the gap, as if there were none
        bends = np.append(bends, np.abs(0.5 * (after[0] - one) - (one - two)))
    else:
        missed.append(own - one)  # what levels off at the end is no knock
    size = np.min(np.abs(missed))
    off_line = after - one - (one - two) * np.arange(2, len(after) + 2)
    return bool(
        np.ptp(np.sign(missed)) == 0
        and size > max(2.0 * _ABOVE_NOISE * noise, _ABOVE_BENDS * np.max(bends))
        and np.all(np.abs(off_line) < 0.5 * size)
    )


def _excess(values: Float[np.ndarray, " n"], width: int):
    """Return by how much groups are off what is beside them, to one side; 0 if to neither."""
    start = np.arange(_BESIDE, len(values) - _BESIDE - width + 1)
    before = np.array([values[start - k] for k in range(1, _BESIDE + 1)])
    after = np.array([values[start + width - 1 + k] for k in range(1, _BESIDE + 1)])
    missed = []
    for i in range(width):
        own, share = values[start + i], (i + 1.0) / (width + 1.0)
        missed += [
            own - before[0] - (i + 1.0) * (before[0] - before[1]),
            own - after[0] - (width - i) * (after[0] - after[1]),
            own - before[0] - share * (after[0] - before[0]),
        ]
    excess = np.maximum(np.min(missed, axis=0), 0.0) + np.minimum(np.max(missed, axis=0), 0.0)
    return start, excess, np.concatenate([before[::-1], after])


def _local_noise(values: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return the robust deviation of what changes from sample to sample, around each sample.

    At an end it is that next to it.
    """
    sizes = np.abs(np.diff(values, 3)) / np.sqrt(20.0)
    width = min(_NEIGHBOURHOOD, len(sizes))
    middle = np.clip(np.arange(len(values)) - 1 - width // 2, 0, len(sizes) - width)
    medians = np.median(np.lib.stride_tricks.sliding_window_view(sizes, width), axis=1)
    return 1.4826 * medians[middle]
