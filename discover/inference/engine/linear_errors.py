"""Errors of a bench in which records are linear: gain, zeros, drifts, loadings, moduli."""

from typing import Any

import numpy as np
from jaxtyping import Float

from discover.inference.engine.priors import Deviations
from discover.inference.engine.problem import (
    SCATTER_KNOWN,
    SCATTER_OF_RUNS,
    SOUND_GAIN,
    Problem,
)
from discover.inference.engine.rows import Rows

_NEXT_TO_NONE = 1e-9
"""Width of what there is none of."""


class LinearErrors:
    """Gain of all runs; zero, drift and, where each is its own, loading of each; errors of moduli.

    `problem`, `rows`: what is known of them, and the rows that have them. `moduli`: how many
    independent errors the moduli have. `deviations`: what is known of each kind, all about zero,
    with its place among the sizes.
    """

    def __init__(self, problem: Problem, rows: Rows, moduli: int):
        self.rows, self._loaded, runs = rows, bool(problem.loading), len(rows.runs)
        self._own = (rows.run[:, None] == np.arange(runs)).astype(float)
        level = self._own * rows.size[:, None]
        self._zeros = np.column_stack([level, level * (rows.time - 0.5)[:, None]])
        own = Deviations(SCATTER_OF_RUNS, SCATTER_KNOWN)
        gain, zeros = Deviations(SOUND_GAIN), own
        if problem.computed:
            gain = zeros = Deviations(_NEXT_TO_NONE)
        parts = [(1, gain), (2 * runs, zeros)]
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
    def of_runs(self) -> slice:
        """Places of the zero, drift and loading that each run has of its own."""
        return slice(1, 1 + (2 + self._loaded) * len(self.rows.runs))

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
        return np.column_stack([predicted, self._zeros, loadings, shifts])

    def recorded(
        self,
        predicted: Float[np.ndarray, "trials rows"],
        sizes: Float[np.ndarray, "trials q"],
        shifts: Float[np.ndarray, "rows k"],
    ) -> Float[np.ndarray, "trials rows"]:
        """Return records of trials, of what the model predicts of each."""
        runs, k = len(self.rows.runs), shifts.shape[1]
        gain, zeros, rest = sizes[:, :1], sizes[:, 1 : 1 + 2 * runs], sizes[:, 1 + 2 * runs :]
        if self._loaded:
            gain, rest = gain + rest[:, self.rows.run], rest[:, runs:]
        found = predicted * (1.0 + gain) + zeros @ self._zeros.T
        return found + rest[:, :k] @ shifts.T if k else found

    def through(
        self,
        slopes: Float[np.ndarray, "rows m"],
        predicted: Float[np.ndarray, " rows"],
        sizes: Float[np.ndarray, " q"],
    ) -> Float[np.ndarray, "rows m"]:
        """Return derivatives of the records, of those of what the model predicts."""
        del predicted  # these errors are in proportion to it, or do not depend on it
        gain = np.full(len(self.rows), 1.0 + sizes[0])
        if self._loaded:
            gain += sizes[1 + 2 * len(self.rows.runs) :][self.rows.run]
        return slopes * gain[:, None]
