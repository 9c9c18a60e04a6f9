"""Records that follow a law as if they had been read otherwise: run by run, or beyond a level.

A sample is loaded, dries, or stands at another temperature, a zero is set and a range of the torque
chosen anew for every run. What that does is small and smooth, and constants of a law take most of
it up: what is left may pass for noise where any pattern is asked for. But of each such fault it is
known, but for one number a run, what it does to a record; and a law is one for all runs.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal, get_args

import numpy as np
from jaxtyping import Float
from scipy.stats import f as fisher

from discover.statistics.covariance import least_squares_covariance
from discover.statistics.residual import Expectation

Misreading = Literal["factor", "zero", "growth", "above", "below", "modes"]
"""A factor, a zero or a factor that grows in time, of each run; a factor above or below a level;
and a factor on the modulus of each mode, of a spectrum that was told wrong."""

CLEAR = 1e-4
"""Probability up to which a fault is believed: of right laws in white noise one in a thousand has a
fault of 1e-3, in noise correlated to 0.95 from sample to sample one in a hundred one of 1e-4."""

POSSIBLE = 0.1
"""Probability up to which a fault is not ruled out, so that what is said has to hold with it: of
right laws in white noise one in twenty-five, in noise correlated to 0.9 one in five."""

_LEVELS = 24
_LOWEST, _HIGHEST = 0.05, 0.95
"""Share of the samples that has to lie on either side of a level."""

_FEWEST = 8  # samples of a run that has a say

_RANGES = "measure one flow in both ranges of the transducer"
_ADVICE: dict[Misreading, str] = {
    "factor": "filling, temperature or rate may have differed from run to run: repeat a run, or "
    "fit those of one loading alone",
    "zero": "read the zero before and after each run",
    "growth": "a sample that dries, reacts, warms or is lost at its edge does that: repeat the "
    "first run last",
    "above": _RANGES,
    "below": _RANGES,
    "modes": "measure the linear moduli again, on the same sample",
}

_ROUNDING = 1e-12

_SEEN = 1e-2
"""Of what a fault does, that constants of the law leave of it at least where they do not do it."""


@dataclass(frozen=True)
class Reading:
    """A run as a law predicts it, in one unit.

    Attributes
    ----------
    times
        Of the samples in s, shape (n,); they only number states.
    predicted, residual
        Of the law, and that minus the record, shape (n,).
    columns
        Changes of the prediction along constants that were fitted, shape (constants, n).
    even
        By what they are multiplied so that noise has one size, shape (n,); by nothing by default.
    control
        What was controlled, as a protocol says it.
    modes
        Change of the prediction per relative change of each modulus; None where they are not asked.
    shared
        Changes of the prediction by errors that all runs share, of unit variance each: those that a
        sweep leaves of the moduli. None without any.
    """

    times: Float[np.ndarray, " n"]
    predicted: Float[np.ndarray, " n"]
    residual: Float[np.ndarray, " n"]
    columns: Float[np.ndarray, "constants n"]
    even: Float[np.ndarray, " n"] | None = None
    control: str = "rate"
    modes: Float[np.ndarray, "modes n"] | None = None
    shared: Float[np.ndarray, "errors n"] | None = None

    @property
    def has_zero(self) -> bool:
        """Whether it has a zero that may be set wrong, and a course in time."""
        return self.control == "rate"

    @property
    def has_level(self) -> bool:
        """Whether it is a stress that a transducer read sample by sample."""
        return self.control in ("rate", "steady")

    @property
    def weight(self) -> Float[np.ndarray, " n"]:
        """What makes its noise one of the size of the record."""
        even = np.ones(len(self.times)) if self.even is None else self.even
        return even / (_rms(even * (self.predicted - self.residual)) or 1.0)


@dataclass(frozen=True)
class Misread:
    """How records are described better than by the law as it is.

    Attributes
    ----------
    kind
        Which of the faults.
    sizes
        Of the runs: factors less one, zeros in their unit, or by how much a factor grows over the
        run; or the one factor less one.
    level
        Stress from which on, or up to which, the factor holds; 0 of a fault of runs.
    probability
        That it is noise and constants that it describes, with the price of all that were tried.
    gain
        Of log likelihood.
    steps
        How far the constants move with it from where they fit best without.
    changes
        What it adds to each run, in its unit.
    size
        Root-mean-square of that over the prediction's, mean over runs.
    beside_sweep
        Whether the probability allows for what a sweep leaves open of the moduli.
    """

    kind: Misreading
    sizes: tuple[float, ...]
    level: float
    probability: float
    gain: float
    steps: Float[np.ndarray, " constants"]
    changes: Sequence[np.ndarray]
    size: float
    beside_sweep: bool = False

    def excused(self, expectation: Expectation) -> bool:
        """Return whether linear data, or loadings, err by as much."""
        if self.beside_sweep:  # what the sweep may err by is in the probability
            expectation = replace(expectation, linear_error=0.0)
        return expectation.excuses(self.size)


def misread(runs: Sequence[Reading]) -> Misread | None:
    """Return the fault by which records are described best; None where none can be told.

    The constants that the columns stand for are fitted along, and so is a factor that all runs
    share: a modulus is no fault of the runs. How probable sizes so large are is told by the
    covariance that noise of these residuals, correlated as they are, gives them   [Wald 1943,
    Trans. Am. Math. Soc. 54, 426].

    Parameters
    ----------
    runs
        Fitted, or not; of one of fewer than eight samples nothing is asked.
    """
    runs = [run for run in runs if len(run.times) >= _FEWEST and np.any(run.predicted)]
    rows = [row for run in runs for row in (run.predicted, run.residual, run.columns)]
    if not runs or not all(np.all(np.isfinite(row)) for row in rows):
        return None
    problem = _Problem(runs)
    found = [one for kind in get_args(Misreading) if (one := problem.best(kind)) is not None]
    return min(found, key=lambda one: one.probability, default=None)


def clear_misreading(
    sets: Sequence[Sequence[Reading]], expectation: Expectation, least: float
) -> Misread | None:
    """Return the fault by which records are described clearly better; None if by none.

    Parameters
    ----------
    sets
        Sets of runs that are asked, such as those fitted and those with others beside them.
    expectation
        What a complete law may leave: the error of linear data, or what repeats differ by.
    least
        Relative size that arithmetic explains.
    """
    sets = [runs for runs in sets if runs]
    found = [one for runs in sets if (one := misread(runs)) is not None]
    clear = [one for one in found if len(sets) * one.probability <= CLEAR and one.size > least]
    seen = [one for one in clear if not one.excused(expectation)]
    return min(seen, key=lambda one: one.probability, default=None)


def reads(found: Misread) -> str:
    """Return how the records would have been read, as a clause."""
    low, high = min(found.sizes), max(found.sizes)
    if found.kind in ("above", "below"):
        return (
            f"as if the transducer read {1 + found.sizes[0]:.4g} times the stress {found.kind} "
            f"{found.level:.2g} Pa"
        )
    if found.kind == "zero":
        return f"as if each run had been read from a zero of its own ({low:.2g} to {high:.2g} Pa)"
    if found.kind == "growth":
        span = f"{100 * low:.2g} to {100 * high:.2g} %"
        return f"as if each run had grown by a share of its own while it lasted ({span})"
    if found.kind == "modes":
        return (
            f"as if the moduli of the modes were {1 + low:.3g} to {1 + high:.3g} times those told"
        )
    return (
        "as if each run had been read by a factor of its own, of which the largest is "
        f"{100 * (high - low):.2g} % more than the least"
    )


def advice(found: Misread) -> str:
    """Return what to do about it, as a clause."""
    return _ADVICE[found.kind]


def not_ruled_out(found: Misread) -> str:
    """Return what is to be known of a fault with which all that is said has to hold, too."""
    once = 1.0 / max(found.probability, 1e-9)
    return (
        f"The records follow the law a little better {reads(found)}, which chance alone does once "
        f"in {once:.0f} data sets. Intervals and bands hold either; {advice(found)}."
    )


class _Problem:
    def __init__(self, runs: Sequence[Reading]):
        self._runs = runs
        self._weights = [run.weight for run in runs]
        ends = np.cumsum([0, *(len(run.times) for run in runs)])
        self._rows = [np.arange(low, high) for low, high in pairwise(ends)]
        pairs = list(zip(runs, self._weights, strict=True))
        self._residual = np.concatenate([weight * run.residual for run, weight in pairs])
        self._predicted = np.concatenate([weight * run.predicted for run, weight in pairs])
        self._columns = np.concatenate([weight * run.columns for run, weight in pairs], axis=1)
        self._modes, self._shared = (
            None if any(rows is None for rows in every) else self._together(every)
            for every in ([run.modes for run in runs], [run.shared for run in runs])
        )

    def _together(self, every) -> Float[np.ndarray, "k m"]:
        pairs = zip(every, self._weights, strict=True)
        return np.concatenate([weight * rows for rows, weight in pairs], axis=1)

    def best(self, kind: Misreading) -> Misread | None:
        """Return the likeliest fault of a kind; None where there is none of it."""
        if kind in ("above", "below"):
            return self._of_level(kind)
        if kind == "modes":  # of one the factor is a modulus
            if self._modes is None or len(self._modes) < 2:
                return None
            return self._told(kind, self._modes, self._columns, 0.0, 1)
        asked = [i for i, run in enumerate(self._runs) if kind == "factor" or run.has_zero]
        own = np.zeros((len(asked), len(self._residual)))
        for column, i in zip(own, asked, strict=True):
            run, rows = self._runs[i], self._rows[i]
            shape = {
                "factor": run.predicted,
                "zero": np.full(len(run.times), _rms(run.predicted)),
                "growth": run.predicted * run.times / run.times[-1],
            }[kind]
            column[rows] = self._weights[i] * shape
        beside = self._columns
        if kind == "factor":  # one that all runs share is a modulus, and no fault of theirs
            beside = np.vstack([beside, self._predicted])
        return self._told(kind, own, beside, 0.0, 1) if len(own) else None

    def _of_level(self, kind: Misreading) -> Misread | None:
        runs = [i for i, run in enumerate(self._runs) if run.has_level]
        if not runs:
            return None
        size = np.full(len(self._residual), np.nan)
        for i in runs:
            size[self._rows[i]] = np.abs(self._runs[i].predicted)
        known = size[np.isfinite(size)]
        levels = np.unique(np.quantile(known, np.linspace(_LOWEST, _HIGHEST, _LEVELS)))
        found = []
        for level in levels:
            with np.errstate(invalid="ignore"):
                beyond = size > level if kind == "above" else size <= level
            own = (self._predicted * beyond)[None]
            found.append(self._told(kind, own, self._columns, float(level), len(levels)))
        told = [one for one in found if one is not None]
        return min(told, key=lambda one: one.probability, default=None)

    def _told(
        self, kind: Misreading, own: np.ndarray, beside: np.ndarray, level: float, tried: int
    ) -> Misread | None:
        # constants of the law may do the same, in part or wholly
        free = _without(beside.T, own.T)
        left, seen, turned = np.linalg.svd(free, full_matrices=False)
        kept = seen > _SEEN * np.max(np.linalg.norm(own, axis=1), initial=0.0)
        if not np.all(np.isfinite(free)) or not np.any(kept):
            return None
        free = left[:, kept]
        before = _without(beside.T, self._residual)
        values = -(free.T @ before)
        after = before + free @ values
        covariance, _, noise = least_squares_covariance(
            free, after, self._rows, None if self._shared is None else self._shared.T
        )
        count = len(values)
        freedom = max(noise.effective_samples - count - len(beside), 1.0)
        variance, axes = np.linalg.eigh(covariance)
        # of data without noise there is none
        variance = np.maximum(variance, max(_ROUNDING * float(variance[-1]), 1e-300))
        wald = float(np.sum((axes.T @ values) ** 2 / variance)) / count
        chance = float(fisher.sf(wald, count, freedom))
        worth = 0.5 * noise.effective_samples
        gain = worth * np.log(float(before @ before) / max(float(after @ after), 1e-300))
        sizes = (turned[kept].T / seen[kept]) @ values
        change = own.T @ sizes
        steps = -np.linalg.lstsq(beside.T, change, rcond=1e-9)[0]
        changes = [
            change[rows] / weight for rows, weight in zip(self._rows, self._weights, strict=True)
        ]
        if kind == "zero":
            sizes = sizes * [_rms(run.predicted) for run in self._runs if run.has_zero]
        relative = [
            _rms(one) / _rms(run.predicted) for one, run in zip(changes, self._runs, strict=True)
        ]
        return Misread(
            kind,
            tuple(map(float, sizes)),
            level,
            min(1.0, len(get_args(Misreading)) * tried * chance),
            float(gain),
            steps[: len(self._columns)],
            changes,
            float(np.mean(relative)),
            self._shared is not None and len(self._shared) > 0,
        )


def _without(columns: Float[np.ndarray, "m q"], values: np.ndarray) -> np.ndarray:
    """Return what the columns cannot describe."""
    norms = np.linalg.norm(columns, axis=0)
    kept = columns[:, norms > 0.0] / norms[norms > 0.0]
    if not kept.shape[1]:
        return values
    return values - kept @ np.linalg.lstsq(kept, values, rcond=1e-9)[0]


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
