"""How constants by mode depend on the relaxation time: constant, linear or quadratic in log λ."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from discover.forward import AugmentedModel
from discover.forward.by_mode import DEGREE, link_slope
from discover.forward.least_squares import Fit
from discover.inference.evidence import BARE_MENTION
from discover.inference.problem import FitProblem

_STEPS = (0.0, -1.0, 1.0)
"""From where a new coefficient starts, as a change of the constant by itself for each power of a
decade, or by a factor of e where that is less: the misfit may have a minimum on either side."""

_END = 1e-6
"""Share of its range within which a constant stands at an end, where no coefficient moves it."""


@dataclass(frozen=True)
class Degree:
    """The degree of a constant by mode.

    Attributes
    ----------
    degree
        0 for one constant of all modes.
    evidence
        For each degree over one constant, see `discover.inference.evidence`.
    """

    degree: int = 0
    evidence: tuple[float, ...] = (0.0,)


def positions_of(model: AugmentedModel, degrees: Mapping[str, Degree]) -> list[int]:
    """Return the positions of the coefficients that these degrees have."""
    slices = model.declared.by_mode_slices
    return [slices[n].start + i for n, found in degrees.items() for i in range(found.degree)]


def choose_degrees(
    problem: FitProblem, fit: Fit, degrees: Mapping[str, Degree]
) -> tuple[Fit, dict[str, Degree]]:
    """Return a fit in which constants by mode have the degree that evidence asks for, and these.

    One constant after the other: all degrees are fitted, each from the best of the lower one, and
    the lowest is taken of those about as strong as the strongest (`BARE_MENTION`). Of k modes no
    more than k constants are to be had, so the degree ends at k − 1.
    """
    model, chosen = problem.model, dict(degrees)
    alone = replace(problem, n_candidates=1)  # a degree is not chosen among the candidates
    # an effect that is not in the model has no amplitude to vary
    waiting = [name for name in chosen if model.constant(name)[1] not in fit.free]
    highest = min(DEGREE, len(model.declared.modulus) - 1)
    for name in chosen:
        if name in waiting:
            chosen[name] = Degree()
            continue
        at = [model.declared.by_mode_slices[name].start + i for i in range(highest)]
        rest = tuple(p for p in fit.free if p not in at)
        plain = fit.theta.copy()
        plain[at] = 0.0
        fits = [problem.fit(plain, rest)]
        for degree in range(1, highest + 1):
            starts = _starts(model, name, fits[-1].theta, at[degree - 1])
            if chosen[name].degree == degree:
                starts.append(fit.theta)
            fits.append(problem.best_fit(starts, (*rest, *at[:degree]), rivals=True))
        best = min((trial for trial in fits if trial.usable), key=lambda trial: trial.cost)
        effective = problem.independent_samples(best)
        gains = [0.0] + [
            alone.evidence(fits[0], trial, effective) if trial.usable else -np.inf
            for trial in fits[1:]
        ]
        degree = next(i for i, gain in enumerate(gains) if gain >= max(gains) - BARE_MENTION)
        chosen[name], fit = Degree(degree, tuple(map(float, gains))), fits[degree]
    return fit, chosen


def _starts(model: AugmentedModel, name: str, theta: np.ndarray, at: int) -> list[np.ndarray]:
    """Return starts with a further coefficient, away from the ends of the constant's range."""
    constant, mean = model.constant(name)
    start = theta.copy()
    width = min(constant.high - constant.low, 1.0)
    if min(start[mean] - constant.low, constant.high - start[mean]) < _END * width:
        start[mean] = constant.start
    own = abs(start[mean]) * link_slope(start[mean], constant.low, constant.high)
    starts = [start.copy() for _ in _STEPS]
    for trial, step in zip(starts, _STEPS, strict=True):
        trial[at] = step * min(own, 1.0)
    return starts
