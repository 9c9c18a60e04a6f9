"""A rate that was read in samples, between them: smooth where the samples say so, else straight.

What the samples say is what they say of one another: each is predicted from its neighbours by a
straight line and by a cubic, and the curve is smooth where the cubic predicts far better [leaving
out one at a time: Stone 1974, J. R. Stat. Soc. B 36, 111]. Across a jump neither predicts anything,
so there no spline swings; in noise both predict as badly.
"""

from collections.abc import Sequence
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float
from scipy.interpolate import CubicSpline, PchipInterpolator, make_interp_spline

from discover.protocols.protocol import FlowProtocol, measured_rate

_FEWEST = 6
"""Samples of a stretch that a cubic spline and one of fifth degree can go through."""

_BETTER = 0.5
"""Of the squares that straight lines miss neighbours by, the share that a cubic may leave. Of a
wave read five times a cycle it leaves 0.22, of four times 0.44, of a corner 0.67, of noise 1.1."""

_REACH = 3
"""Samples on each side that judge whether the curve is smooth at one."""

_STRAIGHT = 1e-3
"""Of the largest rate: as near to the curve as straight lines between its knots have to lie."""

_MOST_BETWEEN = 16
_BETWEEN = 4  # points of another curve through the same samples, for each sample

Samples = Float[np.ndarray, " n"]


def sampled_rate(
    times: Sequence[float] | Samples, rates: Sequence[float] | Samples
) -> FlowProtocol:
    """Return the shear rate through samples: a cubic spline where they are smooth, else straight.

    Straight lines between the samples of a wave cut its crests: read seven times a cycle it loses
    7 % of its amplitude, which bends the constants of a law that is fitted to the stress.

    Parameters
    ----------
    times
        In s, strictly increasing, shape (n,).
    rates
        In 1/s, shape (n,).

    Raises
    ------
    InputError
        If they are not numbers, or times do not increase.

    Examples
    --------
    >>> import discover as dc
    >>> import jax.numpy as jnp
    >>> import numpy as np
    >>> times = np.arange(0.0, 20.0, 2 * np.pi / 7)
    >>> wave = dc.sampled_rate(times, np.cos(times))
    >>> bool(abs(wave.rate(jnp.asarray(np.pi)) + 1.0) < 0.01)
    True
    """
    straight = measured_rate(times, rates)
    t, r = np.asarray(straight.table_times), np.asarray(straight.table_rates)
    knots, values = _knots(t, r)
    return straight if len(knots) == len(t) else measured_rate(knots, values)


def another_between_samples(
    protocol: FlowProtocol, times: Samples | None = None
) -> FlowProtocol | None:
    """Return a protocol whose rate is another curve through the same samples.

    What that changes is what nobody knows of the rate: of fifth degree where a cubic spline was
    taken, monotonic where straight lines were   [Fritsch & Carlson 1980, SIAM J. Numer. Anal. 17,
    238]. None where the rate was commanded: constant, a wave, or steps.

    Parameters
    ----------
    protocol
        Any.
    times
        Of the samples, in s; by default the table holds these and nothing else.
    """
    knots, rates = np.asarray(protocol.table_times), np.asarray(protocol.table_rates)
    # a jump at 0 ends what came before the record, which no sample holds
    jump = np.flatnonzero((np.diff(knots) <= 0.0) & (knots[1:] == 0.0))
    first = int(jump[-1]) + 1 if jump.size and float(protocol.begins) < 0.0 else 0
    read, known = _samples(knots[first:], rates[first:], times)
    if protocol.control != "rate" or len(read) < 4 or np.any(np.diff(read) <= 0.0):
        return None
    places = np.arange(_BETWEEN * (len(read) - 1) + 1) / _BETWEEN
    dense = np.union1d(np.interp(places, np.arange(len(read)), read), knots[first:])
    other = np.asarray(PchipInterpolator(read, known)(dense))
    for start, end in _smooth_stretches(read, known):
        inside = (dense >= read[start]) & (dense <= read[end - 1])
        curve = make_interp_spline(read[start:end], known[start:end], k=5)
        other[inside] = curve(dense[inside])
    return replace(
        protocol,
        table_times=jnp.asarray(np.concatenate([knots[:first], dense])),
        table_rates=jnp.asarray(np.concatenate([rates[:first], other])),
    )


def _samples(
    knots: np.ndarray, rates: np.ndarray, times: Samples | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return the samples behind a table, if it is the curve through those at `times`."""
    if times is None or len(times) >= len(knots) or len(times) < _FEWEST:
        return knots, rates
    at = np.clip(np.searchsorted(knots, times), 0, len(knots) - 1)
    read, known = knots[at], rates[at]
    if np.any(np.diff(read) <= 0.0):
        return knots, rates
    curve = _knots(read, known)
    inside = knots >= read[0]
    same = np.sum(inside) == len(curve[0]) and np.allclose(knots[inside], curve[0], rtol=1e-9)
    close = 1e-6 * np.max(np.abs(rates))
    if not same or np.max(np.abs(rates[inside] - curve[1])) > close:
        return knots, rates  # it was made in another way, and its knots are what is known
    return read, known


def _knots(times: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return knots whose straight lines lie on the curve."""
    near = _STRAIGHT * float(np.max(np.abs(rates)))
    knots, values = [times], [rates]
    for start, end in _smooth_stretches(times, rates):
        t = times[start:end]
        curve = CubicSpline(t, rates[start:end])
        width = np.diff(t)
        bend = np.max(np.abs([curve(t[:-1], 2), curve(t[1:], 2)]), axis=0)
        parts = np.ceil(width * np.sqrt(bend / (8.0 * near))) if near > 0.0 else np.ones(len(width))
        parts = np.clip(parts, 1, _MOST_BETWEEN).astype(int)
        for count in np.unique(parts[parts > 1]):
            shares = np.arange(1, count) / count
            some = (t[:-1][parts == count, None] + width[parts == count, None] * shares).ravel()
            knots.append(some)
            values.append(curve(some))
    found = np.concatenate(knots)
    order = np.argsort(found, kind="stable")
    return found[order], np.concatenate(values)[order]


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
    # a constant is predicted by both, and is a straight line
    least = (1e-9 * np.max(np.abs(rates))) ** 2
    return (summed[1] < _BETTER * summed[0]) & (summed[0] > least)


def _predicted(places: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return at each place the polynomial through some values, by Lagrange, shape (m,)."""
    total = np.zeros(len(at))
    for i in range(places.shape[1]):
        weight = np.ones(len(at))
        for j in range(places.shape[1]):
            if j != i:
                weight *= (at - places[:, j]) / (places[:, i] - places[:, j])
        total += weight * values[:, i]
    return total
