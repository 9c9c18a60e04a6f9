"""What a fault of reading does to records: run by run, or beyond a level of the stress.

A sample is loaded, dries, or stands at another temperature, a zero is set and a range of the torque
chosen anew for every run. What that does is small and smooth, and constants of a law take most of
it up. But of each such fault it is known, but for one number a run, what it does to a record.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, get_args

import numpy as np
from jaxtyping import Float, Int

from discover.statistics.noise.covariance import least_squares_covariance
from discover.statistics.projection import rms, without

FaultKind = Literal["factor", "zero", "growth", "above", "below", "bent", "modes", "further_mode"]
"""A factor, a zero and a factor that grows in time, of each run; a factor above or below a level;
a factor that grows with the stress, as of a transducer that is not quite linear; a factor on the
modulus of each mode, of a spectrum that was told wrong; and a mode that the spectrum lacks."""

KINDS: tuple[FaultKind, ...] = get_args(FaultKind)

_LEVELS = 24
_LOWEST, _HIGHEST = 0.05, 0.95
"""Share of the samples that has to lie on either side of a level."""

_FEWEST = 8  # samples of a run that has a say

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
    further
        Change of the prediction by one more mode of the modulus of all, one row for each of its
        relaxation times, shape (times, n), and these times in s; None where none is asked.
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
    further: tuple[Float[np.ndarray, "times n"], Float[np.ndarray, " times"]] | None = None

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
        return even / (rms(even * (self.predicted - self.residual)) or 1.0)


@dataclass(frozen=True)
class Fault:
    """What a fault does to the records of a `Session`, and what else describes them.

    Attributes
    ----------
    kind
        Which it is.
    own
        Change of all records per unit of each of its sizes, shape (sizes, samples).
    level
        Of the stress in its unit, or the time of a mode in s; 0 of a fault of runs.
    tried
        Number of levels, or of times, that are asked.
    positive
        Whether its size cannot be below zero.
    """

    kind: FaultKind
    own: Float[np.ndarray, "sizes m"]
    level: float = 0.0
    tried: int = 1
    positive: bool = False


@dataclass(frozen=True)
class Estimate:
    """Sizes of a fault, as far as constants of the law do not do the same.

    Attributes
    ----------
    seen
        Sizes to coordinates in which they are told, shape (k, sizes).
    values, covariance
        The coordinates, and what the noise leaves open of them.
    before, after
        Squares of what is left of the records without the fault and with it.
    effective_samples
        Number of independent samples.
    """

    seen: Float[np.ndarray, "k sizes"]
    values: Float[np.ndarray, " k"]
    covariance: Float[np.ndarray, "k k"]
    before: float
    after: float
    effective_samples: float


_FLOORS = (0.03, 0.1, 0.3)
"""Of noise in proportion to the stress: its least size, at the size of that at the root mean square
of the record."""


def _weights(runs: Sequence[Reading]) -> list[Float[np.ndarray, " n"]]:
    """Return by what each run is multiplied so that its noise is of one size.

    Many instruments are off by a share of what they read. A sample that is twice as loud counts as
    one that is not, and the loud end of a start-up reads as a drift: of right laws in noise of 1 %
    of each sample one in fourteen had one, and none in two hundred with these weights. Whether the
    noise is in proportion, and down to where, Schwarz's criterion says by the differences of
    neighbours, of all runs together.
    """
    plain = [run.weight for run in runs]
    sizes = [np.abs(run.predicted) * weight for run, weight in zip(runs, plain, strict=True)]
    rough = [np.diff(run.residual * weight) for run, weight in zip(runs, plain, strict=True)]

    def cost(floor: float | None) -> float:
        total = 0.0
        for size, steps in zip(sizes, rough, strict=True):
            noise = np.ones(len(size)) if floor is None else np.hypot(floor, size)
            variance = noise[1:] ** 2 + noise[:-1] ** 2
            spread = max(float(np.mean(steps**2 / variance)), 1e-300)
            total += len(steps) * np.log(spread) + float(np.sum(np.log(variance)))
        return total + (0.0 if floor is None else np.log(sum(map(len, rough))))

    best = min((None, *_FLOORS), key=cost)
    if best is None:
        return plain
    found = []
    for run, weight, size in zip(runs, plain, sizes, strict=True):
        own = weight / np.hypot(best, size)
        found.append(own / rms(own * (run.predicted - run.residual)))
    return found


class Session:
    """Runs as a law predicts them, weighed so that the noise of each is a like share of it.

    Parameters
    ----------
    runs
        Of one of fewer than eight samples nothing is asked.
    """

    def __init__(self, runs: Sequence[Reading]):
        self.runs = [run for run in runs if len(run.times) >= _FEWEST and np.any(run.predicted)]
        rows = [row for run in self.runs for row in (run.predicted, run.residual, run.columns)]
        self.is_told = bool(self.runs) and all(bool(np.all(np.isfinite(row))) for row in rows)
        if not self.is_told:
            return
        self.weights = _weights(self.runs)
        ends = np.cumsum([0, *(len(run.times) for run in self.runs)])
        self.rows: list[Int[np.ndarray, " _"]] = [np.arange(a, b) for a, b in pairwise(ends)]
        pairs = list(zip(self.runs, self.weights, strict=True))
        self.residual = np.concatenate([weight * run.residual for run, weight in pairs])
        self.predicted = np.concatenate([weight * run.predicted for run, weight in pairs])
        self.columns = np.concatenate([weight * run.columns for run, weight in pairs], axis=1)
        self.modes, self.shared = (
            None if any(rows is None for rows in every) else self._together(every)
            for every in ([run.modes for run in self.runs], [run.shared for run in self.runs])
        )

    def _together(self, every) -> Float[np.ndarray, "k m"]:
        pairs = zip(every, self.weights, strict=True)
        return np.concatenate([weight * rows for rows, weight in pairs], axis=1)

    def faults(self, kind: FaultKind) -> Iterator[Fault]:
        """Yield the faults of a kind that these runs may have, one for each level.

        Their sizes are shares: of the stress, of a modulus, or, of a zero, of the root-mean-square
        of what the run is predicted to be.
        """
        if kind in ("above", "below"):
            yield from self._of_level(kind)
        elif kind == "bent":
            yield from self._bent()
        elif kind == "modes":  # of one the factor is a modulus
            if self.modes is not None and len(self.modes) >= 2:
                yield Fault(kind, self.modes)
        elif kind == "further_mode":
            yield from self._further()
        else:
            own = self._of_runs(kind)
            if len(own):
                yield Fault(kind, own)

    def _of_runs(self, kind: FaultKind) -> Float[np.ndarray, "runs m"]:
        asked = [i for i, run in enumerate(self.runs) if kind == "factor" or run.has_zero]
        own = np.zeros((len(asked), len(self.residual)))
        for column, i in zip(own, asked, strict=True):
            run = self.runs[i]
            if kind == "factor":
                shape = run.predicted
            elif kind == "zero":
                shape = np.full(len(run.times), rms(run.predicted))
            else:
                shape = run.predicted * run.times / run.times[-1]
            column[self.rows[i]] = self.weights[i] * shape
        return own

    def _of_level(self, kind: FaultKind) -> Iterator[Fault]:
        size = np.full(len(self.residual), np.nan)
        for run, rows in zip(self.runs, self.rows, strict=True):
            if run.has_level:
                size[rows] = np.abs(run.predicted)
        known = size[np.isfinite(size)]
        if not len(known):
            return
        levels = np.unique(np.quantile(known, np.linspace(_LOWEST, _HIGHEST, _LEVELS)))
        for level in levels:
            with np.errstate(invalid="ignore"):
                beyond = size > level if kind == "above" else size <= level
            yield Fault(kind, (self.predicted * beyond)[None], float(level), len(levels))

    def _further(self) -> Iterator[Fault]:
        """Yield one more mode, of each time that is asked."""
        told = [run.further for run in self.runs if run.further is not None]
        if not told or len(told) < len(self.runs):
            return
        rows = self._together([own for own, _ in told])
        for own, time in zip(rows, told[0][1], strict=True):
            yield Fault("further_mode", own[None], float(time), len(rows), positive=True)

    def _bent(self) -> Iterator[Fault]:
        """Yield σ|σ| over the largest stress, in whose unit its size is."""
        sizes = [float(np.max(np.abs(run.predicted))) for run in self.runs if run.has_level]
        if not sizes:
            return
        own = np.zeros(len(self.residual))
        for run, rows, weight in zip(self.runs, self.rows, self.weights, strict=True):
            if run.has_level:
                own[rows] = weight * run.predicted * np.abs(run.predicted) / max(sizes)
        yield Fault("bent", own[None])

    def estimate(
        self, own: Float[np.ndarray, "sizes m"], beside: Float[np.ndarray, "q m"]
    ) -> Estimate | None:
        """Return sizes of faults beside what else is fitted; None where none can be told.

        Parameters
        ----------
        own
            What they do, as of a `Fault`.
        beside
            What else changes the records.
        """
        # constants of the law may do the same, in part or wholly
        free = without(beside.T, own.T)
        left, seen, turned = np.linalg.svd(free, full_matrices=False)
        kept = seen > _SEEN * np.max(np.linalg.norm(own, axis=1), initial=0.0)
        if not np.all(np.isfinite(free)) or not np.any(kept):
            return None
        free = left[:, kept]
        before = without(beside.T, self.residual)
        values = -(free.T @ before)
        after = before + free @ values
        shared = None if self.shared is None else self.shared.T
        covariance, _, noise = least_squares_covariance(free, after, self.rows, shared)
        variance, axes = np.linalg.eigh(covariance)
        # of data without noise there is none
        variance = np.maximum(variance, max(_ROUNDING * float(variance[-1]), 1e-300))
        return Estimate(
            seen[kept, None] * turned[kept],
            values,
            (axes * variance) @ axes.T,
            float(before @ before),
            float(after @ after),
            noise.effective_samples,
        )
