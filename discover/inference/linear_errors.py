"""Errors of a bench in which records are linear: gains, zeros, drifts, loadings, moduli."""

from typing import Any

import numpy as np
from jaxtyping import Float, Int

from discover.inference.priors import Deviations
from discover.inference.problem import (
    SCATTER_KNOWN,
    SCATTER_OF_RUNS,
    SOUND_GAIN,
    Problem,
)
from discover.inference.rows import Rows, transducer_of

_NEXT_TO_NONE = 1e-9
"""Width of what there is none of."""

_IN_TIME = ("rate", "stress")
"""Controls of records in time, which have the zero of their transducer."""


class LinearErrors:
    """Gain and zero of each transducer; zero, drift, loading of each run; errors of moduli.

    How far zeros of runs are off is told by those of transducers too, and the other way round: runs
    that were tared together are off together.

    `problem`, `rows`: what is known of them, and the rows that have them. `moduli`: how many
    independent errors the moduli have. `deviations`: what is known of each kind, all about zero,
    with its place among the sizes.
    """

    def __init__(self, problem: Problem, rows: Rows, moduli: int):
        self.rows, self._loaded, runs = rows, bool(problem.loading), len(rows.runs)
        self._own = (rows.run[:, None] == np.arange(runs)).astype(float)
        read_by = [[transducer_of(run) == one for one in problem.transducers] for run in rows.runs]
        in_time = [[run.protocol.control in _IN_TIME] for run in rows.runs]
        self._read_by = np.array(read_by, float)[rows.run]
        common = (np.array(read_by) & np.array(in_time))[rows.run] * problem.levels
        level = self._own * rows.size[:, None]
        self._zeros = np.column_stack([common, level, level * (rows.time - 0.5)[:, None]])
        own = Deviations(SCATTER_OF_RUNS, SCATTER_KNOWN)
        gain, zeros = Deviations(SOUND_GAIN), own
        if problem.computed:
            gain = zeros = Deviations(_NEXT_TO_NONE)
        self._gains = len(problem.transducers)
        parts = [(self._gains, gain), (self._zeros.shape[1], zeros)]
        if self._loaded:
            parts.append((runs, Deviations(problem.loading) if problem.loads_anew else own))
        parts.append((moduli, Deviations(1.0)))
        ends = np.cumsum([0, *[count for count, _ in parts]])
        self.deviations = [
            (slice(low, high), one)
            for low, high, (_, one) in zip(ends, ends[1:], parts, strict=False)
        ]

    def __len__(self) -> int:
        return int(self.deviations[-1][0].stop)

    @property
    def of_transducers(self) -> slice:
        """Places of the gains and zeros of transducers, which all runs share."""
        return slice(0, 2 * self._gains)

    @property
    def of_runs(self) -> slice:
        """Places of the zero, drift and loading that each run has of its own."""
        first = self.of_transducers.stop
        return slice(first, first + (2 + self._loaded) * len(self.rows.runs))

    def gain(self, sizes: Float[np.ndarray, " q"]) -> Float[np.ndarray, " rows"]:
        """Return what the transducer of each row multiplies by."""
        return 1.0 + self._read_by @ sizes[: self._gains]

    def transducer_reading(
        self, predicted: Float[np.ndarray, " rows"], sizes: Float[np.ndarray, " q"]
    ) -> Float[np.ndarray, " rows"]:
        """Return records by what transducers do, without what each run has of its own."""
        common = self._zeros[:, : self._gains] @ sizes[self._gains : self.of_transducers.stop]
        return predicted * self.gain(sizes) + common

    @property
    def usual_widths(self) -> Float[np.ndarray, " q"]:
        """Standard deviations as they usually are."""
        counts = [at.stop - at.start for at, _ in self.deviations]
        return np.repeat([known.size for _, known in self.deviations], counts)

    def widths(self, sizes: Float[np.ndarray, " q"], least: Any = 0.0) -> Float[Any, "*least q"]:
        """Return the standard deviations, as far as the sizes tell of them themselves.

        `least`: times the usual size, for what does not tell yet; one or several.
        """
        found = np.empty((len(sizes), *np.shape(least)))
        for at, known in self.deviations:
            found[at] = known.width(sizes[at], least)
        return found.T

    def log_density(self, sizes: Float[np.ndarray, "*trials q"]) -> Any:
        """Return the log density of sizes before the data."""
        return sum(known.log_density(sizes[..., at]) for at, known in self.deviations)

    def columns(
        self,
        predicted: Float[np.ndarray, " rows"],
        shifts: Float[np.ndarray, "rows k"],
    ) -> Float[np.ndarray, "rows q"]:
        """Return what one of each does to the records, in Pa.

        `predicted`: records as the model alone predicts them. `shifts`: what errors of the moduli
        do to these.
        """
        loadings = self._own * predicted[:, None] if self._loaded else self._own[:, :0]
        read = self._read_by * predicted[:, None]
        return np.column_stack([read, self._zeros, loadings, shifts])

    def recorded(
        self,
        predicted: Float[np.ndarray, "trials rows"],
        sizes: Float[np.ndarray, "trials q"],
        shifts: Float[np.ndarray, "rows k"],
    ) -> Float[np.ndarray, "trials rows"]:
        """Return records of trials, of what the model predicts of each."""
        runs, k = len(self.rows.runs), shifts.shape[1]
        behind = self._gains + self._zeros.shape[1]
        zeros, rest = sizes[:, self._gains : behind], sizes[:, behind:]
        gain = sizes[:, : self._gains] @ self._read_by.T
        if self._loaded:
            gain, rest = gain + rest[:, self.rows.run], rest[:, runs:]
        found = predicted * (1.0 + gain) + zeros @ self._zeros.T
        return found + rest[:, :k] @ shifts.T if k else found

    def like(
        self, fitted: "LinearErrors", sizes: Float[np.ndarray, "*draws q"]
    ) -> Float[np.ndarray, "*draws own"]:
        """Return sizes here of those of fitted runs: what is shared, and what a run had there.

        Zero, drift and loading of a run that was not fitted are none.
        """
        found = np.zeros((*sizes.shape[:-1], len(self)))
        found[..., self.of_transducers] = sizes[..., self.of_transducers]
        shared = sizes[..., fitted.of_runs.stop :]
        found[..., self.of_runs.stop :] = shared[..., : len(self) - self.of_runs.stop]
        each = sizes[..., fitted.of_runs].reshape(*sizes.shape[:-1], -1, len(fitted.rows.runs))
        known = self.places_in(fitted)
        own = np.where(known >= 0, each[..., known], 0.0)
        found[..., self.of_runs] = own.reshape(*sizes.shape[:-1], -1)
        return found

    def places_in(self, fitted: "LinearErrors") -> Int[np.ndarray, " runs"]:
        """Return where each run stands among fitted ones; -1 of another."""
        place = {run.name: i for i, run in enumerate(fitted.rows.runs)}
        return np.array([place.get(run.name, -1) for run in self.rows.runs])

    def unshared_variance(
        self,
        predicted: Float[np.ndarray, " rows"],
        sizes: Float[np.ndarray, " q"],
        variances: Float[np.ndarray, " q"],
        fitted: "LinearErrors",
    ) -> Float[np.ndarray, " rows"]:
        """Return the variance of what runs have of their own that are like some fitted ones.

        `sizes`, `variances`: of the errors of those, which are `fitted`.
        """
        at = fitted.of_runs
        each = (sizes[at] ** 2 + variances[at]).reshape(-1, len(fitted.rows.runs))
        columns = self.columns(predicted, np.zeros((len(predicted), 0)))[:, self.of_runs]
        return columns**2 @ np.repeat(np.mean(each, axis=1), len(self.rows.runs))

    def through(
        self,
        slopes: Float[np.ndarray, "rows m"],
        predicted: Float[np.ndarray, " rows"],
        sizes: Float[np.ndarray, " q"],
    ) -> Float[np.ndarray, "rows m"]:
        """Return derivatives of the records, of those of what the model predicts."""
        del predicted  # these errors are in proportion to it, or do not depend on it
        gain = self.gain(sizes)
        if self._loaded:
            gain += sizes[self._gains + self._zeros.shape[1] :][self.rows.run]
        return slopes * gain[:, None]
