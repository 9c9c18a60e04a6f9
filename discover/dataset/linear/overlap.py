"""Two neighbouring tests laid over each other: shift factors of the overlap, with their error."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.interpolate import BSpline, PchipInterpolator
from scipy.optimize import least_squares
from scipy.stats import f as variance_ratio
from scipy.stats import norm
from scipy.stats import t as student

from discover.dataset.linear.linear_tests import LinearTest, directions
from discover.errors import InputError
from discover.statistics.noise.noise_model import independent_samples

_FEWEST = 4  # samples of each in the overlap, below which neighbours are not laid over
_STEPS = 241
_FACTOR_TWO = 0.3
# Of two overlaps whose misfits differ by no more than such noise would in this share of cases, the
# longer one counts
_CHANCE = 0.99
_TURNS = 3  # how often a shift is fitted: by it samples come into the overlap or leave it
# Largest degree, least distance of knots in decades, and fewest samples for each constant, of the
# smooth curve: moduli of a broad spectrum bend no faster. Schwarz's criterion says how many
_CUBIC, _KNOT, _SAMPLES_A_KNOT = 3, 0.5, 2
_UNKNOWN = 2.0  # standard error in decades of a shift of which an overlap says nothing
_FLOOR = 0.01  # relative error below which no sample counts for more: no test repeats itself better
_DECADE = np.log(10.0)


class Overlap(NamedTuple):
    """The shift of one test over another."""

    shift: Float[np.ndarray, " 2"]  # log10 of a_T and b_T of the warmer over the colder
    covariance: Float[np.ndarray, "2 2"]  # what neighbouring samples share counts once


class _Curve(NamedTuple):
    """Log values of a test over its log arguments, with weights."""

    x: np.ndarray
    values: np.ndarray  # shape (k, n)
    weight: np.ndarray

    @classmethod
    def of(cls, test: LinearTest, where: str) -> "_Curve":
        """Return those of a test; InputError if it has too few samples."""
        argument, first = np.unique(test.argument, return_index=True)
        if len(first) < _FEWEST:
            raise InputError(
                f"Shifting needs {_FEWEST} samples; the {test.name} at {where} has fewer."
            )
        weight = _FLOOR / np.hypot(_FLOOR, test.spread[first])
        return cls(np.log10(argument), np.log10(test.values[:, first]), weight)


class _Pair:
    """Log curves of one kind of test at two temperatures."""

    def __init__(self, cold: LinearTest, warm: LinearTest, where: str):
        self.fixed, self.moving = _Curve.of(cold, where), _Curve.of(warm, where)
        self.along, self.up = directions(cold.kind)

    @property
    def trials(self) -> np.ndarray:
        """Values of log a_T at which anything overlaps."""
        (x, *_), (z, *_) = self.fixed, self.moving
        return self.along * np.linspace(x[0] - z[-1], x[-1] - z[0], _STEPS)

    def inside(self, shift: float) -> np.ndarray:
        """Return which samples of the warmer lie in the range of the colder."""
        moved = self.moving.x + self.along * shift
        return np.flatnonzero((moved >= self.fixed.x[0]) & (moved <= self.fixed.x[-1]))

    def off(self, shift: float, rows: np.ndarray) -> np.ndarray:
        """Return what log values of the warmer lie above the colder, shape (k, n)."""
        # a sample may leave the overlap by a little
        moved = self.moving.x[rows] + self.along * shift
        return self.moving.values[:, rows] - self._through_fixed(moved)

    @cached_property
    def _through_fixed(self) -> PchipInterpolator:
        """The curve through the colder, made once for all shifts that are tried."""
        return PchipInterpolator(self.fixed.x, self.fixed.values, axis=1)


_Used = list[tuple[_Pair, np.ndarray]]
"""Pairs of which enough overlaps, with the samples that do."""


def lay_over(
    cold: Mapping[str, LinearTest], warm: Mapping[str, LinearTest], vertical: bool, where: str
) -> Overlap:
    """Return the one shift that lays tests by kind over those at a lower temperature.

    `vertical`: whether values too may be moved. `where`: the two temperatures, in words. Raises
    InputError if nothing overlaps, or only curves of other shapes.
    """
    pairs = [_Pair(cold[kind], warm[kind], where) for kind in cold if kind in warm]
    # power laws slide along themselves if they may move up too: first without that
    starts = (_longest(pairs, up) for up in ((False, True) if vertical else (False,)))
    shift = next((start for start in starts if start is not None), None)
    if shift is None:
        raise InputError(
            f"No shift in time brings the tests at {where} within a factor of two of each other. "
            "They share no moduli, or differ in more than time; measure between them, or leave "
            "temperatures out with --between."
        )
    found = _refine(_overlapping(pairs, shift), shift, vertical)
    for _ in range(_TURNS - 1):
        shift = float(found.shift[0])
        used = _overlapping(pairs, shift)
        found = _refine(used, shift, vertical) if used else found
    return found


def overlap_misfit(cold: LinearTest, warm: LinearTest) -> float | None:
    """Root-mean-square relative misfit of two tests, as the fit weighs; None if few overlap."""
    used = _overlapping([_Pair(cold, warm, "")], 0.0)
    if not used:
        return None
    off, weight, _ = _stacked(used, 0.0)
    return float(_DECADE * np.sqrt(np.average(off**2, weights=weight**2)))


def _longest(pairs: list[_Pair], up: bool) -> float | None:
    """Return log a_T of the longest overlap of those that agree best; None if none agree."""

    def misfit(shift: float) -> tuple[float, float]:
        used = _overlapping(pairs, shift)
        if not used:
            return np.inf, 0.0
        off, weight, sign = _stacked(used, shift)
        if up:
            off = off - sign * np.average(sign * off, weights=weight**2)
        return float(np.average(off**2, weights=weight**2)), float(np.sum(weight**2))

    trials = np.concatenate([pair.trials for pair in pairs])
    squares, counts = np.array([misfit(shift) for shift in trials]).T
    best = int(np.argmin(squares))
    if not squares[best] < _FACTOR_TWO**2:
        return None
    # few samples may agree by chance: of all overlaps that are no worse, the one with most
    chance = variance_ratio.ppf(_CHANCE, np.maximum(counts, 1.0), max(counts[best] - 1.0, 1.0))
    alike = np.flatnonzero(squares <= chance * squares[best])
    return float(trials[alike[np.lexsort((squares[alike], -counts[alike]))[0]]])


def _overlapping(pairs: list[_Pair], shift: float) -> _Used:
    rows = ((pair, pair.inside(shift)) for pair in pairs)
    return [(pair, inside) for pair, inside in rows if len(inside) >= _FEWEST]


def _stacked(used: _Used, shift: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return differences, weights and the signs with which log b_T adds to the differences."""
    parts = []
    for pair, rows in used:
        off = pair.off(shift, rows)
        weight = np.broadcast_to(pair.moving.weight[rows], off.shape)
        parts.append((off.ravel(), weight.ravel(), np.full(off.size, -float(pair.up))))
    off, weight, sign = map(np.concatenate, zip(*parts, strict=True))
    return off, weight, sign


def _refine(used: _Used, start: float, vertical: bool) -> Overlap:
    """Return the shift by which one smooth curve goes through both tests of every pair best.

    A curve drawn through the samples of one of them would bend with its noise, and seem to know the
    shift from bends that are none.
    """
    off, weight, sign = _stacked(used, start)
    up = float(np.average(sign * off, weights=weight**2)) if vertical else 0.0
    curves = [curve for pair, rows in used for curve in _smooth_curves(pair, rows, start, up)]

    def left(shift: np.ndarray) -> list[np.ndarray]:
        return [curve.left(shift[0], shift[1] if vertical else 0.0) for curve in curves]

    free = 1 + vertical
    first = [start, up][:free]
    found = least_squares(lambda shift: np.concatenate(left(shift)), first, x_scale=0.1)
    ends = zip(curves, left(found.x), strict=True)
    parts = [part for curve, one in ends for part in np.split(one, [len(curve.fixed.x)])]
    n, spent = len(found.fun), free + sum(curve.constants for curve in curves)
    alone = min(sum(independent_samples(part) for part in parts), float(n)) * (n - spent) / n
    variance = float(np.sum(found.fun**2)) / max(n - spent, 1)
    # what neighbours share, such as a shape that differs, counts once
    variance *= (n - spent) / max(alone, 1.0)
    covariance = np.zeros((2, 2))
    # straight lines slide along themselves: then the error is large, and not undefined
    known = found.jac.T @ found.jac + variance / _UNKNOWN**2 * np.eye(free)
    covariance[:free, :free] = variance * np.linalg.inv(known)
    # few independent samples: their scatter is itself uncertain
    wide = student.ppf(0.975, max(alone, 1.0)) / norm.ppf(0.975)
    shift = np.array([found.x[0], found.x[1] if vertical else 0.0])
    return Overlap(shift, wide**2 * covariance)


@dataclass(frozen=True)
class _SmoothCurve:
    """One curve of a test at two temperatures, and the knots of the spline through both."""

    fixed: _Curve  # the colder
    moving: _Curve
    along: int
    up: int
    knots: np.ndarray
    degree: int

    @property
    def constants(self) -> int:
        """Constants of the spline."""
        return len(self.knots) - self.degree - 1

    def left(self, shift: float, up: float) -> np.ndarray:
        """Return what the best spline leaves of both, weighted."""
        (x, low, heavy), (z, high, weight) = self.fixed, self.moving
        weights = np.concatenate([heavy, weight])
        places = np.concatenate([x, z + self.along * shift])
        values = weights * np.concatenate([low, high + self.up * up])
        basis = BSpline.design_matrix(places, self.knots, self.degree, extrapolate=True).toarray()
        basis = weights[:, None] * basis
        return values - basis @ np.linalg.lstsq(basis, values)[0]


def _smooth_curves(
    pair: _Pair, rows: np.ndarray, shift: float, up: float
) -> Iterator[_SmoothCurve]:
    """Yield the curves of a pair where it overlaps, each as smooth as its samples allow."""
    (x, colder, heavy), (z, warmer, weight) = pair.fixed, pair.moving
    moved = z[rows] + pair.along * shift
    # the samples of the colder on both sides of the end ones are needed to lie between them
    first = max(int(np.searchsorted(x, moved.min(), "right")) - 1, 0)
    last = min(int(np.searchsorted(x, moved.max(), "left")), len(x) - 1)
    there = slice(first, last + 1)
    ends = min(x[first], moved.min()), max(x[last], moved.max())
    n = len(rows) + last + 1 - first
    most = min(int(np.ceil((ends[1] - ends[0]) / _KNOT)), n // _SAMPLES_A_KNOT - _CUBIC)
    forms = [(degree, 1) for degree in range(1, _CUBIC)]
    forms += [(_CUBIC, intervals) for intervals in range(1, max(most, 1) + 1)]

    def criterion(curve: _SmoothCurve) -> float:
        square = float(np.sum(curve.left(shift, up) ** 2))
        return n * np.log(max(square, 1e-300)) + curve.constants * np.log(n)

    for cold, warm in zip(colder, warmer, strict=True):
        fixed = _Curve(x[there], cold[there], heavy[there])
        moving = _Curve(z[rows], warm[rows], weight[rows])
        splines = []
        for degree, intervals in forms:
            inner = np.linspace(*ends, intervals + 1)
            knots = np.concatenate([[ends[0]] * degree, inner, [ends[1]] * degree])
            splines.append(_SmoothCurve(fixed, moving, pair.along, pair.up, knots, degree))
        yield min(splines, key=criterion)
