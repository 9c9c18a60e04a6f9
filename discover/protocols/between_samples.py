"""A rate that was read in samples, between them: smooth where the samples say so, else straight.

Each sample is predicted from its neighbours by a straight line and by a cubic, and the curve is
smooth where the cubic predicts far better   [leaving out one at a time: Stone 1974, J. R. Stat.
Soc. B 36, 111]. Across a jump, and in noise, neither does.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from scipy.interpolate import CubicSpline, PchipInterpolator, make_interp_spline

from discover.programs import on_device
from discover.protocols.protocol import FlowProtocol, measured_rate

_FEWEST = 6
"""Samples of a stretch that a cubic spline and one of fifth degree can go through."""

_BETTER = 0.5
"""Of the squares that straight lines miss neighbours by, the share that a cubic may leave. Of a
wave read five times a cycle it leaves 0.22, of four times 0.44, of a corner 0.67, of noise 1.1."""

_REACH = 3
"""Samples on each side that judge whether the curve is smooth at one."""

_STRAIGHT, _NEARLY = 1e-3, 3e-4
"""Of the largest rate: as near to the curve as straight lines between its knots have to lie, and
those between samples that need no knot between them: of a wave read 130 times a cycle."""

_FLAT = 1e-9
"""Of the largest rate: what straight lines miss of a constant, or of one."""

_MOST_BETWEEN = 16
_BETWEEN = 4  # points of another curve through the same samples, for each sample

Samples = Float[np.ndarray, " n"]


def sampled_rate(
    times: Sequence[float] | Samples, rates: Sequence[float] | Samples
) -> FlowProtocol:
    """Return the shear rate through samples: a cubic spline where they are smooth, else straight.

    Straight lines between the samples of a wave cut its crests: read seven times a cycle it loses
    7 % of its amplitude, which bends the constants of a law that is fitted to the stress.

    `times`, `rates`: in s, strictly increasing, and in 1/s, shape (n,); else InputError.
    """
    straight = measured_rate(times, rates)
    t, r = np.asarray(straight.table_times), np.asarray(straight.table_rates)
    knots, values = knots_between(t, r)
    return straight if len(knots) == len(t) else measured_rate(knots, values)


def knots_between(
    times: Samples, rates: Samples, another: bool = False
) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
    """Return knots whose straight lines lie on the curve, and have its area in each interval.

    `another`: whether to take another curve through the samples, as `another_between_samples`.
    """
    stretches = _smooth_stretches(times, rates)
    knots, values = [times], [rates]
    if another:
        straight = np.ones(len(times) - 1, dtype=bool)
        for start, end in stretches:
            straight[start : end - 1] = False
        parts = np.where(straight, _BETWEEN, 1)
        _fill(times, PchipInterpolator(times, rates), parts, knots, values)
    largest = max(float(np.max(np.abs(rates))), np.finfo(float).tiny)
    for start, end in stretches:
        t = times[start:end]
        cubic = CubicSpline(t, rates[start:end])
        bend = np.max(np.abs([cubic(t[:-1], 2), cubic(t[1:], 2)]), axis=0)
        missed = np.diff(t) ** 2 * bend / (8.0 * largest)
        least = np.where(missed > _NEARLY, 2, 1)
        parts = np.clip(np.ceil(np.sqrt(missed / _STRAIGHT)), least, _MOST_BETWEEN).astype(int)
        curve = make_interp_spline(t, rates[start:end], k=5) if another else cubic
        _fill(t, curve, parts, knots, values)
    found = np.concatenate(knots)
    order = np.argsort(found, kind="stable")
    return found[order], np.concatenate(values)[order]


def another_between_samples(protocol: FlowProtocol, times: Samples) -> FlowProtocol | None:
    """Return a protocol whose rate is another curve through the same samples, at `times` in s.

    It is of fifth degree for a cubic spline, monotonic for straight lines   [Fritsch & Carlson
    1980, SIAM J. Numer. Anal. 17, 238]. None where the rate was commanded.
    """
    knots, rates = np.asarray(protocol.table_times), np.asarray(protocol.table_rates)
    # a jump at 0 ends what came before the record, which no sample holds
    jump = np.flatnonzero((np.diff(knots) <= 0.0) & (knots[1:] == 0.0))
    first = int(jump[-1]) + 1 if jump.size and float(protocol.begins) < 0.0 else 0
    read, known = _samples(knots[first:], rates[first:], times)
    if protocol.control != "rate" or len(read) < 4 or np.any(np.diff(read) <= 0.0):
        return None
    other_knots, other = knots_between(read, known, another=True)
    return replace(
        protocol,
        table_times=on_device(np.concatenate([knots[:first], other_knots])),
        table_rates=on_device(np.concatenate([rates[:first], other])),
    )


def samples_of(
    protocol: FlowProtocol, times: Samples
) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
    """Return times in s and rates in 1/s of a rate that was read in samples.

    `times`: of the record; where that was thinned, what its rate was read in before.
    """
    return _samples(np.asarray(protocol.table_times), np.asarray(protocol.table_rates), times)


def _samples(knots: np.ndarray, rates: np.ndarray, times: Samples) -> tuple[np.ndarray, np.ndarray]:
    """Return the samples behind a table, if it is the curve through those at `times`."""
    if len(times) >= len(knots) or len(times) < _FEWEST:
        return knots, rates
    at = np.clip(np.searchsorted(knots, times), 0, len(knots) - 1)
    read, known = knots[at], rates[at]
    if np.any(np.diff(read) <= 0.0):
        return knots, rates
    curve = knots_between(read, known)
    inside = knots >= read[0]
    same = np.sum(inside) == len(curve[0]) and np.allclose(knots[inside], curve[0], rtol=1e-9)
    close = 1e-6 * np.max(np.abs(rates))
    if not same or np.max(np.abs(rates[inside] - curve[1])) > close:
        return knots, rates  # it was made in another way, and its knots are what is known
    return read, known


def _fill(t: np.ndarray, curve, parts: np.ndarray, knots: list, values: list) -> None:
    """Add the knots that divide each interval of a curve into so many parts."""
    width, area = np.diff(t), np.diff(curve.antiderivative()(t))
    for count in np.unique(parts[parts > 1]):
        here = parts == count
        places = t[:-1][here, None] + width[here, None] * np.arange(count + 1) / count
        rate = curve(places)
        # the strain is kept: else straight lines would lose some of every crest
        lost = area[here] - np.trapezoid(rate, places, axis=1)
        rate = rate + (lost / width[here] * count / (count - 1))[:, None]
        knots.append(places[:, 1:-1].ravel())
        values.append(rate[:, 1:-1].ravel())


def _smooth_stretches(times: np.ndarray, rates: np.ndarray) -> list[tuple[int, int]]:
    """Return where samples are smooth: first of each stretch, and the one after its last."""
    smooth = _is_smooth(times, rates)
    edges = np.flatnonzero(np.diff(smooth.astype(int), prepend=0, append=0))
    stretches = zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
    return [(start, end) for start, end in stretches if end - start >= _FEWEST]


def _is_smooth(times: np.ndarray, rates: np.ndarray) -> Bool[np.ndarray, " n"]:
    """Return at which samples a cubic through neighbours predicts far better than a line."""
    n = len(times)
    if n < _FEWEST:
        return np.zeros(n, dtype=bool)
    rates = rates / max(float(np.max(np.abs(rates))), np.finfo(float).tiny)
    inner = np.arange(1, n - 1)
    # two on each side, and at the ends the four nearest on whichever side they lie
    first = np.clip(inner - 2, 0, n - 5)
    around = first[:, None] + np.arange(5)
    others = around[around != inner[:, None]].reshape(-1, 4)
    line = np.stack([inner - 1, inner + 1], axis=1)
    squares = [
        (_predicted(times[some], rates[some], times[inner]) - rates[inner]) ** 2
        for some in (line, others)
    ]
    summed = [np.convolve(np.pad(one, 1), np.ones(2 * _REACH + 1), "same") for one in squares]
    return (summed[1] < _BETTER * summed[0]) & (summed[0] > _FLAT**2)


def _predicted(places: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return at each place the polynomial through some values, by Lagrange, shape (m,)."""
    k = places.shape[1]
    apart = places[:, :, None] - places[:, None] + np.eye(k)
    toward = np.where(np.eye(k, dtype=bool), 1.0, (at[:, None] - places)[:, None])
    return np.sum(np.prod(toward / apart, axis=2) * values, axis=1)


_NEIGHBOURS = 2
"""Intervals on each side of a step in which the rate stays as it is."""

_STANDS_OUT = 10.0
"""Change of the rate in a step over that in any of these intervals."""

_SMALLEST = 0.01
"""Change of the rate, over the largest rate, that is a step."""


@dataclass(frozen=True)
class RateStep:
    """A step of the rate between two samples, at `start` and `end` in s."""

    start: float
    end: float
    change: float  # of the rate in 1/s, from the one to the other
    share: float = 0.5  # of the interval at whose end the rate steps, if that is not fitted
    place: int | None = None  # which of the fitted shares is its own; None if it is not fitted

    def at(self, share: float) -> float:
        """Return a time in s from a share of the interval."""
        return self.start + share * (self.end - self.start)


def steps_between_samples(
    protocol: FlowProtocol, time: Float[np.ndarray, " n"], rate: Float[np.ndarray, " n"]
) -> tuple[RateStep, ...]:
    """Return the steps of a rate whose instants its samples, in s and 1/s, do not tell.

    The rate changes from one sample to the next, and hardly before and after: a straight line
    between the two errs by up to half the strain of the interval.
    """
    if protocol.control != "rate" or np.any(np.asarray(protocol.amplitudes)) or len(time) < 4:
        return ()
    knots, levels = np.asarray(protocol.table_times), np.asarray(protocol.table_rates)
    change = np.diff(rate)
    size, smallest = np.abs(change), _SMALLEST * float(np.max(np.abs(rate)))
    found = []
    for i in np.flatnonzero(size > smallest):
        around = np.r_[size[max(i - _NEIGHBOURS, 0) : i], size[i + 1 : i + 1 + _NEIGHBOURS]]
        first_or_last = i == 0 or i == len(size) - 1
        if first_or_last or _STANDS_OUT * np.max(around) > size[i]:
            continue
        at = int(np.searchsorted(knots, time[i]))
        straight = (
            at + 1 < len(knots)
            and np.array_equal(knots[at : at + 2], time[i : i + 2])
            and np.allclose(levels[at : at + 2], rate[i : i + 2], rtol=0.0, atol=0.1 * size[i])
        )
        if straight:
            found.append(RateStep(float(time[i]), float(time[i + 1]), float(change[i])))
    return tuple(found)
