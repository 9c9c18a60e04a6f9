"""What faults of reading too small for any test to see leave open of the constants of a law.

No instrument reads exactly, no two loadings are alike, and constants take up most of what that does
to a record. An interval that allows for noise alone shrinks with the number of samples, until it is
less than such a fault moves its constant by, and says more than any measurement can. Here every
kind of fault (`discover.statistics.reading.reading_faults`) is in every run, with sizes that are
normal about zero and of one of a few widths, all of which are equally probable before the data.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from discover.statistics.noise.covariance import HALF_BAND
from discover.statistics.reading.reading_faults import FaultKind, Reading, Session

WIDTHS = (0.005, 0.01, 0.02)
"""Standard deviations of the sizes, of the stress or the modulus. A choice: from what a calibrated
transducer errs by to what careful fillings differ by. What repeats differ by counts where it is
more; that loadings of one melt differ by 10 % is reported too (docs/findings.md)."""


@dataclass(frozen=True)
class Allowance:
    """What small faults leave open of the constants that were fitted.

    Attributes
    ----------
    steps
        How far the constants move in the mean, shape (constants,).
    covariance
        About that, beside what noise leaves open, shape (constants, constants).
    """

    steps: Float[np.ndarray, " q"]
    covariance: Float[np.ndarray, "q q"]

    @property
    def about_the_fit(self) -> Float[np.ndarray, "q q"]:
        """Second moment of how far the constants move, where an interval stays about the fit."""
        return self.covariance + np.outer(self.steps, self.steps)

    def holding(self, position: int, value: float, low: float, high: float) -> tuple[float, float]:
        """Return a 95 % interval of a constant that holds small faults too.

        Parameters
        ----------
        position
            Of the constant among those that were fitted.
        value, low, high
            Where it fits best, and the interval that allows for noise alone.
        """
        middle = value + float(self.steps[position])
        spread = HALF_BAND**2 * max(float(self.covariance[position, position]), 0.0)
        if not np.isfinite(middle + spread):
            return low, high
        below, above = (float(np.hypot(one - value, np.sqrt(spread))) for one in (low, high))
        return min(low, middle - below), max(high, middle + above)


def small_faults(runs: Sequence[Reading], loading: float = 0.0) -> Allowance | None:
    """Return what small faults of reading leave open of the constants; None where none is told.

    Sizes of faults are normal with the noise and each of some widths, so what the records say of
    them is too, and the constants follow to first order   [Gelman et al. 2013, Bayesian Data
    Analysis, ch. 14]. Widths, and levels from which on a range reads otherwise, are weighed by
    their evidence, and of the mixture the mean and the covariance are kept.

    Parameters
    ----------
    runs
        The fitted runs.
    loading
        Relative error of one run as repeats tell it: the width of its factor is no less.
    """
    session = Session(runs)
    if not session.is_told or not len(session.columns):
        return None
    norms = np.linalg.norm(session.columns, axis=1)
    if not np.all(norms > 0.0):
        return None
    inverse = np.linalg.pinv(session.columns.T / norms, rcond=1e-9) / norms[:, None]
    weights, steps, squares = [], [], []
    for own, least in _of_a_session(session, loading):
        moves = -inverse @ own.T
        for weight, mean, covariance in _posteriors(session, own, least):
            weights.append(weight)
            steps.append(moves @ mean)
            squares.append(moves @ covariance @ moves.T + np.outer(steps[-1], steps[-1]))
    share = np.exp(np.array(weights) - np.max(weights))
    share /= np.sum(share)
    mean = np.tensordot(share, steps, axes=1)
    covariance = np.tensordot(share, squares, axes=1) - np.outer(mean, mean)
    return Allowance(mean, covariance)


def _of_a_session(
    session: Session, loading: float
) -> Iterator[tuple[Float[np.ndarray, "sizes m"], Float[np.ndarray, " sizes"]]]:
    """Yield what all kinds of faults at once do to the records, for each level of a range.

    With it the least width of each size. A factor below a level is one above it, and one of all
    runs.
    """
    kinds: tuple[FaultKind, ...] = ("zero", "growth", "bent")
    if session.shared is None or not len(session.shared):  # else the sweep tells how far they err
        kinds = (*kinds, "modes")
    factors = [fault.own for fault in session.faults("factor")]
    every = [*factors, *(fault.own for kind in kinds for fault in session.faults(kind))]
    for own in [fault.own for fault in session.faults("above")] or [np.zeros_like(every[0][:0])]:
        together = np.concatenate([*every, own])
        least = np.zeros(len(together))
        least[: sum(map(len, factors))] = loading
        yield together, least


def _posteriors(
    session: Session, own: Float[np.ndarray, "sizes m"], least: Float[np.ndarray, " sizes"]
) -> Iterator[tuple[float, Float[np.ndarray, " sizes"], Float[np.ndarray, "sizes sizes"]]]:
    """Yield the log evidence of each width, and the mean and covariance of the sizes given it."""
    found = session.estimate(own, session.columns)
    for width in WIDTHS:
        prior = np.diag(np.maximum(width, least) ** 2)
        if found is None:  # constants do all that it does
            yield 0.0, np.zeros(len(prior)), prior
            continue
        spread = found.covariance + found.seen @ prior @ found.seen.T
        gain = np.linalg.solve(spread, found.seen @ prior).T
        weight = _log_density(found.values, spread) - _log_density(found.values, found.covariance)
        yield weight, gain @ found.values, prior - gain @ found.seen @ prior


def _log_density(values: Float[np.ndarray, " k"], covariance: Float[np.ndarray, "k k"]) -> float:
    """Return the logarithm of a normal density about zero, but for a constant."""
    square = float(values @ np.linalg.solve(covariance, values))
    return -0.5 * (square + float(np.linalg.slogdet(covariance)[1]))
