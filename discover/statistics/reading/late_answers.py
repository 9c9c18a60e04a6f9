"""Records that follow a law as through an instrument that answers late, or averages.

What a filter of the instrument does to a record is known but for one time: where the stress changes
fast, above all in the first samples after a step of the rate, it is as much as a missing term would
do, and elsewhere nearly nothing. A few such samples in every run do not look like structure to a
test that allows noise to be louder in some places than in others. But of such noise the sizes and
signs that a filter gives are not to be expected, run after run.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from jaxtyping import Float
from scipy.interpolate import PchipInterpolator
from scipy.stats import t as student

from discover.statistics.noise.independent_samples import independent_samples
from discover.statistics.projection import rms, without
from discover.statistics.residual import fast_part

Late = Literal["delay", "lag", "mean_since", "mean_about"]
"""A delay, a lag of first order, a mean over the last time, or over a time about the sample."""

_SHAPES = 2
"""Kinds that differ: a delay, a lag and a mean over what has been are one, to first order."""

_TIMES = 24
_SHORTEST, _LONGEST = 0.25, 0.25
"""Of the interval between samples, and of the time that a run takes."""

_FINE = 8  # points of a lag's integration from sample to sample
_CLEAR = 10.0
"""Gain of log likelihood from which on a filter is looked at: of chance 5 has one in a thousand."""
AGREED = 0.05
"""Probability of sizes that agree, up to which a filter that describes records so much better is
believed: noise that is loud where the filter acts, and nowhere else, passes for one as often."""

_SEEN = 0.5
"""Deviation of the filter's size as one run tells it, up to which that run has a say."""


@dataclass(frozen=True)
class Response:
    """A run as a law predicts it, from rest.

    Attributes
    ----------
    times
        Of the samples in s, shape (n,); the flow begins at zero.
    predicted, residual
        Of the law, and that minus the record, shape (n,), in one unit.
    columns
        Changes of the prediction along constants that were fitted, shape (constants, n).
    """

    times: Float[np.ndarray, " n"]
    predicted: Float[np.ndarray, " n"]
    residual: Float[np.ndarray, " n"]
    columns: Float[np.ndarray, "constants n"]


@dataclass(frozen=True)
class LateAnswer:
    """The filter by which records are described best.

    Attributes
    ----------
    kind, time
        Which, and its time in s.
    gain
        Of log likelihood, by the one time.
    probability
        Of sizes that agree so well from run to run, if it is noise that they describe.
    size
        Root-mean-square of what it does to the records, over theirs, mean over runs.
    """

    kind: Late
    time: float
    gain: float
    probability: float
    size: float


@dataclass(frozen=True)
class Filtered:
    """The filter that describes records best beside constants that may move.

    Attributes
    ----------
    kind, time
        Which, and its time in s.
    before, after
        Sums of squares over the noise, without it and with it; that is one in all.
    worth
        Share of the samples that are independent.
    changes
        What the filter adds to each run, in the unit of its stress.
    steps
        How far the constants move with it.
    noise
        Of each run, in that unit.
    """

    kind: Late
    time: float
    before: float
    after: float
    worth: float
    changes: Sequence[np.ndarray]
    steps: Float[np.ndarray, " constants"]
    noise: Sequence[float]

    @property
    def gain(self) -> float:
        """Gain of log likelihood by the one time."""
        return 0.5 * (self.before - self.after) * self.worth


def late_answer(runs: Sequence[Response]) -> LateAnswer | None:
    """Return the filter that describes records clearly better than none; None if none does.

    Of each kind and time all constants that the columns stand for are fitted along. How large the
    filter is, one by the law, is then asked of each run by itself: noise that is loud where the
    filter acts gives a size of either sign, so that its mean over the runs is zero within their
    spread   [Student 1908, Biometrika 6, 1]. A run that is too quiet to tell has no say, and one
    run alone tells nothing.
    """
    runs = [run for run in runs if len(run.times) > _FINE and np.any(run.residual)]
    best = best_filter(runs) if len(runs) > 1 else None
    if best is None or best.gain < _CLEAR:
        return None
    sizes = [
        rms(change) / (rms(run.predicted) or 1.0)
        for change, run in zip(best.changes, runs, strict=True)
    ]
    pairs = zip(best.changes, best.noise, strict=True)
    columns, residual = _stacked(runs, best.noise)
    probability = _agreement(columns, residual, [change / one for change, one in pairs])
    return LateAnswer(best.kind, best.time, best.gain, probability, float(np.mean(sizes)))


def best_filter(runs: Sequence[Response], noise: Sequence[float] | None = None) -> Filtered | None:
    """Return the filter that describes records best; None without a run.

    Parameters
    ----------
    runs
        As a law predicts them.
    noise
        Of each, in the unit of its stress; by default what changes from sample to sample.
    """
    if not runs:
        return None
    if noise is None:
        noise = [fast_part(run.residual) or 1e-3 * rms(run.residual) or 1.0 for run in runs]
    columns, residual = _stacked(runs, noise)
    shortest = min(float(np.median(np.diff(run.times))) for run in runs)
    longest = min(float(run.times[-1]) for run in runs)
    times = np.geomspace(_SHORTEST * shortest, max(_LONGEST * longest, shortest), _TIMES)
    best: tuple[float, Late, int, list[np.ndarray]] | None = None
    for kind in get_args(Late):
        changes = [_changes(run, kind, times) for run in runs]
        for at in range(len(times)):
            own = [change[at] / one for change, one in zip(changes, noise, strict=True)]
            left = without(columns, residual + np.concatenate(own))
            after = float(left @ left)
            if best is None or after < best[0]:
                best = after, kind, at, [change[at] for change in changes]
    assert best is not None
    after, kind, at, changes = best
    put = np.concatenate([change / one for change, one in zip(changes, noise, strict=True)])
    free, left = without(columns, residual), without(columns, residual + put)
    freedom = max(len(residual) - columns.shape[1] - 1, 1)
    scale = max(after / freedom, 1.0)
    return Filtered(
        kind,
        float(times[at]),
        float(free @ free) / scale,
        after / scale,
        # of correlated noise as many samples are worth fewer
        independent_samples(left) / len(left),
        changes,
        -np.linalg.lstsq(columns, residual + put, rcond=1e-8)[0],
        noise,
    )


def _stacked(runs: Sequence[Response], noise: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
    """Return the columns of all runs and their residuals, over the noise."""
    pairs = list(zip(runs, noise, strict=True))
    columns = [np.asarray(run.columns, dtype=float).T / one for run, one in pairs]
    return np.concatenate(columns), np.concatenate([run.residual / one for run, one in pairs])


def _agreement(
    columns: Float[np.ndarray, "m q"], residual: Float[np.ndarray, " m"], own: Sequence[np.ndarray]
) -> float:
    """Return how probable sizes of the runs that agree so well are, if their mean is zero."""
    ends = np.cumsum([0, *map(len, own)])
    each = np.zeros((len(residual), len(own)))
    for i, change in enumerate(own):
        each[ends[i] : ends[i + 1], i] = -change
    both = np.concatenate([each, columns], axis=1)
    norm = np.maximum(np.linalg.norm(both, axis=0), 1e-300)
    _, seen, turned = np.linalg.svd(both / norm, full_matrices=False)
    inverse = (turned.T / np.maximum(seen, 1e-8 * seen[0])) / norm[:, None]
    deviation = np.linalg.norm(inverse, axis=1)[: len(own)]
    sizes = np.linalg.lstsq(both / norm, residual, rcond=1e-8)[0][: len(own)] / norm[: len(own)]
    told = sizes[deviation < _SEEN]
    if len(told) < 2:
        return 1.0
    # sizes may by chance agree better than each is known
    spread = max(float(np.std(told, ddof=1)), rms(deviation[deviation < _SEEN]))
    error = spread / np.sqrt(len(told))
    ratio = float(np.mean(told)) / max(error, np.finfo(float).tiny)
    return float(min(1.0, _SHAPES * student.sf(ratio, len(told) - 1)))


def _changes(run: Response, kind: Late, widths: Float[np.ndarray, " w"]) -> np.ndarray:
    """Return what filters of a kind add to a prediction, shape (w, n)."""
    begun = run.times[0] <= 0.0
    known = run.times if begun else np.append(0.0, run.times)
    curve = PchipInterpolator(known, run.predicted if begun else np.append(0.0, run.predicted))
    times, wide = run.times, widths[:, None]
    if kind == "delay":
        return _at(curve, times - wide) - run.predicted
    if kind == "lag":
        return _lagged(curve, times, widths) - run.predicted
    area = curve.antiderivative()
    if kind == "mean_since":
        return (area(times) - area(np.maximum(times - wide, 0.0))) / wide - run.predicted
    # what comes after the last sample is not predicted: to one side it would be a delay
    half = np.minimum(wide / 2, np.maximum(times[-1] - times, 1e-9 * times[-1]))
    low, high = np.maximum(times - half, 0.0), times + half
    return (area(high) - area(low)) / (high - low) - run.predicted


def _at(curve: PchipInterpolator, times: np.ndarray) -> np.ndarray:
    """Return a stress that is zero before the flow begins."""
    return np.where(times > 0.0, curve(np.maximum(times, 0.0)), 0.0)


def _lagged(
    curve: PchipInterpolator, times: Float[np.ndarray, " n"], widths: Float[np.ndarray, " w"]
) -> np.ndarray:
    """Return τ y' + y = x from y = 0, shape (w, n), of x that is linear between many points."""
    known = times if times[0] <= 0.0 else np.append(0.0, times)
    points = np.interp(
        np.arange((len(known) - 1) * _FINE + 1) / _FINE, np.arange(len(known)), known
    )
    values, steps = curve(points), np.diff(points)
    out = np.zeros((len(points), len(widths)))
    for i, step in enumerate(steps):
        slope = (values[i + 1] - values[i]) / step
        decay = np.exp(-step / widths)
        out[i + 1] = (out[i] - values[i] + widths * slope) * decay + values[i + 1] - widths * slope
    return out[::_FINE].T[:, len(known) - len(times) :]
