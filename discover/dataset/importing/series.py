"""Courses of a quantity from row to row: held, straight, swinging to and fro, up and down."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.interpolate import PchipInterpolator

from discover.dataset.records.thinning import SPREAD_OF_BENDS, bends
from discover.dataset.run_table import wave_of

Values = Float[np.ndarray, " n"]

CONSTANT = 0.03  # spread of the middle nine tenths up to which an imposed quantity is constant
AT_REST = 0.02  # rate or stress over the largest, below which it is none
_JUMP = 0.1
_STRAIGHT = 0.003
_FEWEST_HELD = 3
# Steady states differ on the way up and down by their scatter. Ten per cent is more than a gap or a
# temperature does within one measurement
APART = 0.1
_ABOVE_SCATTER = 4.0
_FEWEST_OF_BRANCH = 4
_FEWEST_SAMPLES = 20
HARMONICS = 9
_SINE = 0.005  # higher harmonics over the first, up to which a record is a sine
_AS_BEFORE = 0.05  # difference over the amplitude, up to which one cycle repeats another
# share of a period within which a fluid from rest has no stress yet, unless it answers at once
_AT_ONCE = 0.02
_FAR = 0.3
_WHOLE = 1e-3  # share of a period up to which a record is as long as one


def spread(values: Values) -> float:
    """Width of the middle nine tenths of values over their median; inf if that is 0."""
    low, middle, high = np.percentile(values, [5.0, 50.0, 95.0])
    return float((high - low) / abs(middle)) if middle else np.inf


def held(values: Values) -> bool:
    """Return whether nearly all of a record is held, at one level or at several in turn."""
    size = float(np.max(np.abs(values)))
    if size == 0.0 or spread(values) < CONSTANT:
        return True
    jumps = np.flatnonzero(np.abs(np.diff(values)) > _JUMP * size)
    kept = 0
    for piece in np.split(values, jumps + 1):
        low, middle, high = np.abs(np.percentile(piece, [5.0, 50.0, 95.0]))
        constant = abs(high - low) <= CONSTANT * middle or max(low, high) < AT_REST * size
        kept += len(piece) if constant and len(piece) >= _FEWEST_HELD else 0
    return len(jumps) > 0 and kept >= 0.9 * len(values)


def straight(time: Values, values: Values) -> bool:
    """Return whether a record follows a straight line in time."""
    if len(values) < 5 or not np.ptp(time) or not np.ptp(values):
        return False
    line = np.polynomial.Polynomial.fit(time, values, 1)
    return bool(np.percentile(np.abs(values - line(time)), 95.0) < _STRAIGHT * np.ptp(values))


def every_row_differs(rate: Values) -> bool:
    """Return whether every row has another rate, in order, over a factor of three or more."""
    size = np.abs(rate)
    if len(rate) < 3 or np.any(size == 0.0) or not (np.all(rate > 0) or np.all(rate < 0)):
        return False
    steps = np.diff(np.log(size))
    larger = np.abs(steps) > 0.01
    one_way = max(np.mean(steps[larger] > 0), np.mean(steps[larger] < 0)) if larger.any() else 0.0
    return bool(np.mean(larger) > 0.9 and one_way > 0.9 and size.max() > 3.0 * size.min())


def strain_of(time: Values, rate: Values) -> Values:
    """Strain that a rate in 1/s has made since t = 0; constant before the first sample."""
    before = max(float(time[0]), 0.0) * float(rate[0])
    if len(time) < 2:
        return np.full(len(time), before)
    made = PchipInterpolator(time, rate).antiderivative()(time)
    return before + made - made[0]


class UpAndDown(NamedTuple):
    """Stresses on the way down over those at the same rates on the way up."""

    logarithms: Float[np.ndarray, " m"]
    scatter: float  # standard deviation of the logarithm of a stress

    @property
    def apart(self) -> bool:
        """Whether the two ways differ by more than scatter, so that these are no steady states."""
        most = float(np.percentile(np.abs(self.logarithms), 80.0))
        return most > max(APART, _ABOVE_SCATTER * self.scatter)

    @property
    def described(self) -> str:
        """How far they are apart."""
        low, high = np.percentile(np.abs(np.expm1(self.logarithms)), [10.0, 90.0])
        return f"{100 * low:.0f} to {100 * high:.0f} % apart"


def up_and_down(rate: Values, stress: Values) -> UpAndDown | None:
    """Difference of stresses on the ways up and down; None if rates go one way only."""
    use = (rate * np.sign(np.median(rate)) > 0.0) & (stress * np.sign(np.median(stress)) > 0.0)
    if np.sum(use) < 2 * _FEWEST_OF_BRANCH or np.mean(use) < 0.7:
        return None
    x, y = np.log(np.abs(rate[use])), np.log(np.abs(stress[use]))
    if np.ptp(x) < np.log(1.5):
        return None
    steps = np.diff(x)
    turns = np.sign(steps) * (np.abs(steps) > 0.01)
    moving = np.flatnonzero(turns)
    cuts = moving[1:][turns[moving[1:]] != turns[moving[:-1]]]
    ends = zip([0, *cuts], [*(cuts + 1), len(x)], strict=True)
    ways = [slice(a, b) for a, b in ends if b - a >= _FEWEST_OF_BRANCH]
    if len(ways) < 2 or len(cuts) > len(x) // _FEWEST_OF_BRANCH:
        return None
    found, off = [], []
    for way, back in pairwise(ways):
        (first, one), (second, other) = (_in_order(x[w], y[w]) for w in (way, back))
        both = (first >= second[0]) & (first <= second[-1])
        if (x[way][-1] - x[way][0]) * (x[back][-1] - x[back][0]) < 0.0 and both.any():
            found.append(np.interp(first[both], second, other) - one[both])
        off += [bends(first, one), bends(second, other)]
    left = np.abs(np.concatenate(off))
    if not found or not len(left):
        return None
    return UpAndDown(np.concatenate(found), float(SPREAD_OF_BENDS * np.median(left)))


def _in_order(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    places, first = np.unique(x, return_index=True)
    return places, y[first]


def alternates(values: Values) -> bool:
    """Return whether a record swings to and fro about its middle, once at least."""
    if len(values) < _FEWEST_SAMPLES or not np.all(np.isfinite(values)) or not np.ptp(values):
        return False
    low, high = np.min(values), np.max(values)
    if min(high, -low) < 0.3 * max(high, -low):  # one sign: a start-up that overshoots, a ramp
        return False
    outer = np.abs(values) > 0.3 * (high - low) / 2.0
    signs = np.sign(values[outer])
    turns = int(np.sum(signs[1:] != signs[:-1]))
    # a sine spends 0.8 of its time there, noise about zero changes sign from sample to sample
    return turns >= 1 and turns < 0.25 * len(signs) and float(np.mean(outer)) > 0.5


def purer(time: Values, stress: Values, strain: Values) -> bool:
    """Return whether the stress is a sine and the strain is not, so that the stress was imposed."""
    wave = wave_of(time, stress - np.mean(stress)) if np.all(np.diff(time) > 0.0) else None
    if wave is None or (time[-1] - time[0]) * wave[0] < 2.0 * np.pi * 0.99:
        return False  # no wave, or less than a cycle
    phases = wave[0] * time[:, None] * np.arange(1, HARMONICS + 1)
    design = np.concatenate([np.cos(phases), np.sin(phases), np.ones((len(time), 1))], axis=1)
    found, *_ = np.linalg.lstsq(design, np.stack([stress, strain], axis=1), rcond=None)
    sizes = np.hypot(found[:HARMONICS], found[HARMONICS:-1])
    of_stress, of_strain = np.sqrt(np.sum(sizes[1:] ** 2, axis=0)) / sizes[0]
    return bool(of_stress < _SINE and of_strain > max(4.0 * of_stress, 2.0 * _SINE))


def goes_on(time: Values, imposed: Values, answer: Values) -> bool:
    """Whether strain and stress, in either role, begin in steady alternation, not from rest."""
    wave, size = wave_of(time, imposed - np.mean(imposed)), float(np.max(np.abs(answer)))
    if wave is None or size == 0.0:
        return False
    period, step = 2.0 * np.pi / wave[0], float(np.median(np.diff(time)))
    if time[-1] - time[0] + step < period * (1.0 - _WHOLE):
        return False
    if time[0] < _AT_ONCE * period and abs(answer[0]) > _FAR * size:
        return True
    first = time - time[0] < 0.2 * period
    later = time[first] + period
    inside = later <= time[-1]
    if not inside.any():  # one cycle alone: its ends meet, or would with the next sample
        ahead = (time[0] + period - time[-1]) / step
        end = answer[-1] + ahead * 0.5 * (3.0 * answer[-1] - 4.0 * answer[-2] + answer[-3])
        return bool(abs(answer[0] - end) < _AS_BEFORE * size)
    again = np.interp(later[inside], time, answer)
    return bool(np.max(np.abs(answer[first][inside] - again)) < _AS_BEFORE * size)
