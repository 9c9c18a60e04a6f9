"""Runs left out in turn: by how much each hypothesis misses them, and what that says of it.

Where no hypothesis is all there is, evidence is overconfident of the one that comes nearest to the
records, and of its constants. Which one predicts another run is then for runs left out to say
[Bernardo & Smith 1994, Bayesian Theory, 6.1.6; Yao et al. 2018, Bayesian Anal. 13, 917].
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.special import logsumexp, stdtrit

from discover.inference.fits import Fit, Fitter
from discover.inference.priors import Priors
from discover.statistics import HALF_BAND

FEWEST_RUNS = 3
"""Runs from which on those left out weigh hypotheses: of two, each fit would see a single one."""

MOST_MISSED = 1.0
"""Over the size of a run: by more nothing is missed that is called a prediction."""

_ROUNDS = 5

_FIRST, _EXACT = 12, 6
"""Hypotheses that are fitted without each run, of all that are held against one another to first
order, which on measured sets is off by a tenth."""


def left_out(fitter: Fitter, fits: Sequence[Fit]) -> Float[np.ndarray, "fits runs"]:
    """Return the error of each run in fits without it, over its size; all are fitted side by side.

    `fitter`, `fits`: hypotheses fitted to all runs, and what fitted them.
    """
    rows, first = fitter.rows, fitter.problem.model.instants.start
    # where they begin, predictions and derivatives are the same whatever run is left out
    whole = fitter.fit([fitter.start(fit.names, fit.theta, fit.linear) for fit in fits], rounds=0)
    starts = []
    for fit in whole:
        for i, run in enumerate(rows.runs):
            start = replace(fit, without=i, memory={})
            # when a rate steps is read off its own record, and is no prediction
            own = {first + step.place for step in run.rate_steps if step.place is not None}
            if own:
                kept = {at: prior for at, prior in fit.priors.items() if at not in own}
                start.priors, start.slopes = Priors(kept), None
            starts.append(start)
    parts = fitter.fit(starts, _ROUNDS, derivatives=False)
    found = [_error(fitter, part) for part in parts]
    return np.array(found).reshape(len(fits), len(rows.runs))


def _error(fitter: Fitter, part: Fit) -> float:
    """Return the error of the run that a fit does not see."""
    rows = fitter.rows
    at = rows.run == part.without
    with np.errstate(over="ignore", invalid="ignore"):  # without the run the law runs away
        ahead = fitter.errors.transducer_reading(part.predicted, part.linear)
        off = (rows.recorded - ahead)[at] / rows.size[at]
        size = float(np.sqrt(np.mean(off**2)))
    return min(size, MOST_MISSED) if np.isfinite(size) else MOST_MISSED


def left_out_to_first_order(fitter: Fitter, fit: Fit) -> Float[np.ndarray, " runs"]:
    """Return `left_out` of one fit, by one step from where it ended: no prediction is asked for."""
    assert fit.jacobian is not None
    assert fit.covariance is not None
    rows, record = fitter.rows, fitter.record(fit)
    both = np.column_stack([fit.jacobian, rows.recorded - record])
    white = fitter.noise.whitened(both, record, fit.noise)
    stiff = np.linalg.inv(fit.covariance)
    # constants and transducers; zero, drift and loading are of each run
    shared = len(fit.priors) + fitter.errors.of_transducers.stop
    ahead = rows.recorded - fitter.errors.transducer_reading(fit.predicted, fit.linear)
    found = []
    for i in range(len(rows.runs)):
        own, at = white[rows.run[fitter.noise.kept] == i], rows.run == i
        columns, left = own[:, :-1], own[:, -1]
        step = np.linalg.solve(stiff - columns.T @ columns, -columns.T @ left)
        off = (ahead[at] - fit.jacobian[at, :shared] @ step[:shared]) / rows.size[at]
        found.append(np.sqrt(np.mean(off**2)))
    return np.minimum(np.nan_to_num(found, nan=MOST_MISSED), MOST_MISSED)


def screened_to_first_order(fitter: Fitter, fits: Sequence[Fit]) -> list[Fit]:
    """Return the hypotheses that predict runs left out best to first order, the best first."""
    rough = [float(np.sum(left_out_to_first_order(fitter, fit) ** 2)) for fit in fits]
    return [fits[at] for at in np.argsort(rough, kind="stable")[:_FIRST]]


def predictive_mixture(fitter: Fitter, fits: Sequence[Fit]) -> tuple[tuple[Fit, float], ...]:
    """Return how far to rely on the first of some hypotheses, which remember what they miss."""
    some = fits[:_EXACT]
    missed = left_out(fitter, some)
    for fit, own in zip(some, missed, strict=True):
        fit.memory["missed"] = own
    weights = weights_of(missed)
    return tuple((some[at], float(weights[at])) for at in np.argsort(-weights, kind="stable"))


def weights_of(missed: Float[np.ndarray, "fits runs"]) -> Float[np.ndarray, " fits"]:
    """Return how far to rely on each of some hypotheses, by how they miss runs left out.

    Misses of runs are draws from one normal distribution of unknown deviation, which is integrated
    out: the density of R of them goes as the sum of their squares to the power -R/2.
    """
    logs = -0.5 * missed.shape[1] * np.log(np.maximum(np.sum(missed**2, axis=1), 1e-300))
    return np.exp(logs - logsumexp(logs))


def next_run_factor(runs: int) -> float:
    """Return the factor on the deviation of some misses that makes it that of the next.

    As few runs tell a deviation badly, Student's quantile is the wider.
    """
    wider = stdtrit(max(runs - 1, 1), 0.975) / HALF_BAND
    return float(wider * np.sqrt(1.0 + 1.0 / runs))
