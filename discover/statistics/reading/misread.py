"""Records that follow a law as if they had been read otherwise: run by run, or beyond a level.

A sample is loaded, dries, or stands at another temperature, a zero is set and a range of the torque
chosen anew for every run. What that does is small and smooth, and constants of a law take most of
it up: what is left may pass for noise where any pattern is asked for. But of each such fault it is
known, but for one number a run, what it does to a record; and a law is one for all runs.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.stats import f as fisher

from discover.statistics.projection import rms
from discover.statistics.reading.any_correlation import probability_over_correlations
from discover.statistics.reading.reading_faults import KINDS, Fault, FaultKind, Reading, Session
from discover.statistics.residual import Expectation

CLEAR = 1e-4
"""Probability up to which a fault is believed. By the likeliest correlation of the noise alone, of
right laws in white noise one in a thousand has a fault of 1e-3, but in noise correlated to 0.95
from sample to sample one in fifteen has one of 1e-4."""

_WHATEVER_CORRELATION = 0.1
"""What the probability over all correlations of noise counts: it is right as it stands, so that
one of 1e-3 is believed."""

POSSIBLE = 0.1
"""Probability up to which a fault is not ruled out, so that what is said has to hold with it: of
right laws in white noise one in twenty-five, in noise correlated to 0.9 one in five."""

OF_MODES = (
    "measure the linear moduli over these times and declare all modes, or let `close-loop` fit one "
    "more"
)

_RANGES = "measure one flow in both ranges of the transducer"
_ADVICE: dict[FaultKind, str] = {
    "factor": "filling, temperature or rate may have differed from run to run: repeat a run, or "
    "fit those of one loading alone",
    "zero": "read the zero before and after each run",
    "growth": "a sample that dries, reacts, warms or is lost at its edge does that: repeat the "
    "first run last",
    "above": _RANGES,
    "below": _RANGES,
    "bent": "calibrate the transducer at several stresses",
    "modes": "measure the linear moduli again, on the same sample",
    "further_mode": OF_MODES,
}


@dataclass(frozen=True)
class Misread:
    """How records are described better than by the law as it is.

    Attributes
    ----------
    kind
        Which of the faults.
    sizes
        Of the runs: factors less one, zeros in their unit, or by how much a factor grows over the
        run; or the one factor less one; or the modulus of a mode over that of all others.
    level
        Stress from which on, or up to which, the factor holds; the time of a mode in s; 0 of a
        fault of runs.
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

    kind: FaultKind
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
        # what the sweep may err by is in the probability
        if self.beside_sweep and self.kind != "further_mode":
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
    session = Session(runs)
    if not session.is_told:
        return None
    found = [one for kind in KINDS if (one := _likeliest(session, kind)) is not None]
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
    if found.kind == "bent":
        more = f"{100 * abs(low):.2g} % {'more' if low > 0 else 'less'}"
        return f"as if the transducer read {more} at the largest stress than in proportion"
    if found.kind == "further_mode":
        return one_more_mode(found.level, found.sizes[0])
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


def one_more_mode(time: float, share: float) -> str:
    """Return how the records would have been read with a further mode, as a clause.

    Parameters
    ----------
    time
        Its relaxation time in s.
    share
        Its modulus over that of all others.
    """
    return (
        f"as if there were one more relaxation mode, of some {time:.2g} s and {100 * share:.2g} % "
        "of the modulus"
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


def _likeliest(session: Session, kind: FaultKind) -> Misread | None:
    """Return the likeliest fault of a kind; None where there is none of it."""
    found = [_told(session, fault) for fault in session.faults(kind)]
    told = [one for one in found if one is not None]
    return min(told, key=lambda one: one.probability, default=None)


def _told(session: Session, fault: Fault) -> Misread | None:
    beside = session.columns
    if fault.kind == "factor":  # one that all runs share is a modulus, and no fault of theirs
        beside = np.vstack([beside, session.predicted])
    one = session.estimate(fault.own, beside)
    if one is None:
        return None
    count = len(one.values)
    freedom = max(one.effective_samples - count - len(beside), 1.0)
    wald = float(one.values @ np.linalg.solve(one.covariance, one.values)) / count
    tried = len(KINDS) * fault.tried
    probability = tried * float(fisher.sf(wald, count, freedom))
    seen = np.linalg.pinv(one.seen)
    if probability <= CLEAR:
        over = probability_over_correlations(
            fault.own.T @ seen, beside.T, session.residual, session.rows
        )
        probability = max(probability, _WHATEVER_CORRELATION * tried * over)
    gain = 0.5 * one.effective_samples * np.log(one.before / max(one.after, 1e-300))
    sizes = seen @ one.values
    if fault.positive and np.any(sizes <= 0.0):
        return None
    change = fault.own.T @ sizes
    steps = -np.linalg.lstsq(beside.T, change, rcond=1e-9)[0]
    runs = session.runs
    changes = [
        change[rows] / weight for rows, weight in zip(session.rows, session.weights, strict=True)
    ]
    relative = [rms(one) / rms(run.predicted) for one, run in zip(changes, runs, strict=True)]
    if fault.kind == "zero":
        sizes = sizes * [rms(run.predicted) for run in runs if run.has_zero]
    return Misread(
        fault.kind,
        tuple(map(float, sizes)),
        fault.level,
        min(1.0, probability),
        float(gain),
        steps[: len(session.columns)],
        changes,
        float(np.mean(relative)),
        session.shared is not None and len(session.shared) > 0,
    )
