"""Runs that no fit saw: is something missing, or is a constant a little off.

A constant that is a little off leaves a smooth misfit there, by which nothing is missing. So the
constants may move, each as far as the fit leaves it open, and two things are asked: whether they
have to move further than that, and whether a pattern is left then. But a misfit that stands out of
the noise is no prediction, whatever the constants would excuse.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.linalg import solve_triangular, toeplitz
from scipy.stats import chi2

from discover.statistics.lack_of_fit import what_is_left
from discover.statistics.noise.whiteness import SIGNIFICANCE
from discover.statistics.projection import rms
from discover.statistics.residual import (
    FEWEST_FAST,
    STRUCTURE,
    Expectation,
    fast_part,
    slow_part,
    tells_noise,
)

_SMALLEST_SHARE = 1e-2  # of noise, in what changes from sample to sample

CARRIED = 3.0
"""A model that misses the held-out runs by more than so many times what it misses the fitted ones
does not carry over to them. The fitted error is an optimistic guess of the other, by the freedom of
a few constants; three times leaves room for that, and for flows that weigh them otherwise."""

Rows = Sequence[Float[np.ndarray, " _"]]


@dataclass(frozen=True)
class Unseen:
    """What a model leaves of runs that no fit saw.

    Attributes
    ----------
    residuals, records
        Prediction minus measurement of each run, and the measurement, in one unit.
    columns
        Of each run, shape (constants, n): change of the prediction when one of several independent
        combinations of the constants moves by its standard deviation.
    correlation
        Of the noise, samples k apart, from k = 0.
    """

    residuals: Rows
    records: Rows
    columns: Sequence[Float[np.ndarray, "constants _"]]
    correlation: Float[np.ndarray, " _"]

    def without_outliers(self, expectation: Expectation) -> "Unseen":
        """Return the same without samples that are outliers, which refute no law."""
        outliers = what_is_left(self.residuals, self.records, expectation).outlier_samples
        residuals, records, columns = (
            [np.delete(row, list(off), axis=-1) for row, off in zip(part, outliers, strict=True)]
            for part in (self.residuals, self.records, self.columns)
        )
        return Unseen(residuals, records, columns, self.correlation)

    @property
    def error(self) -> float:
        """Mean relative error of the runs that are long enough to judge, or of all."""
        pairs = [*zip(self.residuals, self.records, strict=True)]
        judging = [pair for pair in pairs if len(pair[0]) >= FEWEST_FAST] or pairs
        return float(
            np.mean([np.linalg.norm(r) / (np.linalg.norm(of) or 1.0) for r, of in judging])
        )

    def moved(self) -> tuple[list[np.ndarray], float]:
        """Return the residuals after the constants moved as both kinds of runs ask.

        Returns
        -------
        They, and how probable constants are that have to move so far, if nothing is missing.
        """
        rows = [np.asarray(row, dtype=float) for row in self.residuals]
        columns = [np.asarray(column, dtype=float) for column in self.columns]
        count = len(columns[0]) if columns else 0
        if count == 0 or not all(np.all(np.isfinite(column)) for column in columns):
            return rows, 1.0
        normal, right = np.eye(count), np.zeros(count)
        for row, column in zip(rows, columns, strict=True):
            root = _noise_root(row, self.correlation)
            both = solve_triangular(root, np.vstack([column, row]).T, lower=True)
            normal += both[:, :-1].T @ both[:, :-1]
            right += both[:, :-1].T @ both[:, -1]
        step = np.linalg.solve(normal, right)
        # of a direction that these runs hardly see, noise moves the constants hardly
        power = np.maximum(np.linalg.eigvalsh(normal) - 1.0, 0.0)
        freedom = float(np.sum(power / (1.0 + power)))
        agreement = float(chi2.sf(step @ step, freedom)) if freedom > 0.0 else 1.0
        return [row - step @ column for row, column in zip(rows, columns, strict=True)], agreement


def refutes(unseen: Unseen, residuals: Rows, records: Rows, expectation: Expectation) -> bool:
    """Return whether runs that no fit saw say that something is missing.

    They do if their pattern is larger than their noise; or if one is left after the constants
    moved, in them or in them and the fitted runs together; or if the constants have to move too
    far, of which a pattern that is left is an independent sign   [Fisher 1932, Statistical Methods
    for Research Workers, ch. 4]. What a noise that is given allows, or the error of the linear
    data, is none; nor is what is in runs of a few samples.

    Parameters
    ----------
    unseen
        What is left of these runs.
    residuals, records
        What is left of the fitted runs, where noise explains it: a pattern too weak to show in
        either may show in both. Empty otherwise.
    expectation
        What a complete model may leave.
    """
    if not tells_noise(_weights(unseen.records)) or _allowed(unseen, expectation):
        return False
    fast, slow = _parts(unseen)
    if slow > fast and (
        what_is_left(unseen.residuals, unseen.records, expectation).verdict == "unexplained"
    ):
        return True
    moved, agreement = unseen.moved()
    alone = what_is_left(moved, unseen.records, expectation)
    signs = [agreement] if alone.probability is None else [agreement, alone.probability]
    sum_of_logs = float(np.sum(np.log(np.maximum(signs, 1e-300))))
    if chi2.sf(-2.0 * sum_of_logs, 2 * len(signs)) <= SIGNIFICANCE:
        return True
    every = [*residuals, *moved], [*records, *unseen.records]
    return "unexplained" in (alone.verdict, what_is_left(*every, expectation).verdict)


def _allowed(unseen: Unseen, expectation: Expectation) -> bool:
    """Return whether these runs are missed by no more than is known to be wrong with them."""
    fast, slow = _parts(unseen)
    if expectation.excuses(slow):
        return True
    given = expectation.noise
    if given is None:
        return False
    return bool(np.hypot(fast, slow) <= STRUCTURE * np.hypot(given, expectation.linear_error))


def _parts(unseen: Unseen) -> tuple[float, float]:
    """Return the relative size of what changes from sample to sample, and of the rest."""
    sizes = []
    for row, record in zip(unseen.residuals, unseen.records, strict=True):
        scale = rms(record) or 1.0
        sizes.append([fast_part(row) / scale, slow_part(row) / scale])
    fast, slow = np.sqrt(np.mean(np.square(sizes), axis=0))
    return float(fast), float(slow)


def _weights(records: Rows) -> np.ndarray:
    longest = max((len(record) for record in records), default=0)
    return np.array([np.arange(longest) < len(record) for record in records], dtype=float)


def _noise_root(row: np.ndarray, correlation: Float[np.ndarray, " _"]) -> np.ndarray:
    """Return the Cholesky factor of the covariance of noise that is correlated so.

    Its size is that of what changes from sample to sample, of which such noise has a share.
    """
    known = np.zeros(max(len(row), 4))
    known[: len(correlation[: len(known)])] = correlation[: len(known)]
    share = max(1.0 - 1.5 * known[1] + 0.6 * known[2] - 0.1 * known[3], _SMALLEST_SHARE)
    smallest = 1e-9 * rms(row) or 1.0
    size = max(fast_part(row) / np.sqrt(share), smallest)
    matrix = toeplitz(known[: len(row)]) + _SMALLEST_SHARE**2 * np.eye(len(row))
    return size * np.linalg.cholesky(matrix)
