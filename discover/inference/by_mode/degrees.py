"""How constants by mode depend on the relaxation time: a polynomial in log λ, or free."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from discover.forward import AugmentedModel
from discover.forward.by_mode import DEGREE, link_slope
from discover.inference.by_mode.alone import told_beyond_a_polynomial
from discover.inference.evidence import BARE_MENTION
from discover.inference.least_squares import Fit
from discover.inference.problem import FitProblem

Tried = TypeVar("Tried")

_STEPS = (0.0, -1.0, 1.0)
"""From where a new coefficient starts, as a change of the constant by itself for each power of a
decade, or by a factor of e where that is less: the misfit may have a minimum on either side."""

_END = 1e-6
"""Share of its range within which a constant stands at an end, where no coefficient moves it."""


FREE = DEGREE + 1
"""The rung above the highest degree: each mode that the runs tell by itself has a constant of its
own, and the polynomial stays for the others."""


@dataclass(frozen=True)
class Degree:
    """The degree of a constant by mode.

    Attributes
    ----------
    degree
        0 for one constant of all modes, `FREE` where modes deviate from a polynomial.
    evidence
        For each degree over one constant, see `discover.inference.evidence`.
    own
        Modes that deviate: as many as there are told modes beyond what a polynomial follows.
    is_raised
        Whether a lower one fits as well, and was not to be taken.
    """

    degree: int = 0
    evidence: tuple[float, ...] = (0.0,)
    own: tuple[int, ...] = ()
    is_raised: bool = False

    @property
    def coefficients(self) -> int:
        """Number of coefficients in log λ."""
        return min(self.degree, DEGREE)

    @property
    def places(self) -> list[int]:
        """Places of what varies the constant, among all that may."""
        return [*range(self.coefficients), *(DEGREE + mode for mode in self.own)]


def one_degree_more(model: AugmentedModel, degrees: Mapping[str, Degree]) -> dict[str, int]:
    """Return the next rung of each constant by mode; empty where none has one.

    Parameters
    ----------
    model
        The model.
    degrees
        Degree of each constant by mode.
    """
    highest = _highest(model)
    top = FREE if highest < model.declared.n_modes - 1 else highest
    more = {name: min(found.degree + 1, top) for name, found in degrees.items()}
    return more if any(more[n] > found.degree for n, found in degrees.items()) else {}


def has_added_mode(model: AugmentedModel, free: Sequence[int]) -> bool:
    """Return whether modes with constants by mode of their own are fitted, or known."""
    known = {one.name for one in model.declared.effects}
    return any(name in known or model.positions(name)[0] in free for name in model.adding_modes)


def _highest(model: AugmentedModel) -> int:
    return min(DEGREE, model.declared.n_modes - 1)


def lowest_not_refuted(
    first: Tried, more: Callable[[Tried], Tried | None], is_refuted: Callable[[Tried], bool]
) -> Tried:
    """Return what has the lowest degree that runs held out do not refute; the first where none has.

    A line in log λ may fit as well as a parabola, and be refuted by faster runs. That refutes the
    line. So the next degree is fitted to the same runs, and held against the same others.

    Parameters
    ----------
    first
        What has the degrees that evidence asks for.
    more
        Returns what has one degree more, or None for nothing.
    is_refuted
        Whether it explains the fitted runs, and runs held out speak against it.
    """
    last: Tried | None = first
    while last is not None and is_refuted(last):
        last = more(last)
    return first if last is None else last


def choose_degrees(
    problem: FitProblem,
    fit: Fit,
    degrees: Mapping[str, Degree],
    least: Mapping[str, int] | None = None,
) -> tuple[Fit, dict[str, Degree]]:
    """Return a fit in which constants by mode have the degree that evidence asks for, and these.

    One constant after the other: all degrees are fitted, each from the best of the lower one, and
    the lowest is taken of those about as strong as the strongest (`BARE_MENTION`). Of k modes no
    more than k constants are to be had, so the degree ends at k − 1. Of more modes than that each
    that the runs tell by itself may be free (`FREE`): asked where the highest degree is taken.

    Parameters
    ----------
    problem, fit
        What is fitted to what, and a fit with the degrees so far.
    degrees
        By name of the constant.
    least
        Degrees below which none is taken, by name; by default 0.
    """
    least = least or {}
    model, chosen = problem.model, dict(degrees)
    alone = replace(problem, n_candidates=1)  # a degree is not chosen among the candidates
    # an effect that is not in the model has no amplitude to vary, and one mode alone no other
    alone_in_it = len(model.declared.modulus) < 2 and not has_added_mode(model, fit.free)
    waiting = [n for n in chosen if alone_in_it or model.constant(n)[1] not in fit.free]
    highest = _highest(model)
    for name in chosen:
        if name in waiting:
            chosen[name] = Degree()
            continue
        at = model.varying(name)
        rest = tuple(p for p in fit.free if p not in at)
        plain = fit.theta.copy()
        plain[at] = 0.0
        fits = [problem.fit(plain, rest)]
        for degree in range(1, highest + 1):
            starts = _starts(model, name, fits[-1].theta, at[degree - 1])
            if chosen[name].degree == degree:
                starts.append(fit.theta)
            fits.append(problem.best_fit(starts, (*rest, *at[:degree]), rivals=True))
        if not any(trial.usable for trial in fits):
            continue  # beside the others no constant of its own can be integrated: it stays
        gains = _gains(alone, fits)
        own: tuple[int, ...] = ()
        if fits[-1].usable and (_lowest(gains) == highest or least.get(name, 0) == FREE):
            own = told_beyond_a_polynomial(model, problem.batch, fits[-1], name)
        if own:
            deviating = [at[DEGREE + mode] for mode in own]
            fits.append(problem.fit(fits[-1].theta, (*rest, *at[:highest], *deviating)))
            gains = _gains(alone, fits)
        lowest = _lowest(gains)
        degree = max(lowest, min(least.get(name, 0), len(fits) - 1))
        if not fits[degree].usable:
            degree = lowest
        free = own if degree == FREE else ()
        chosen[name] = Degree(degree, tuple(map(float, gains)), free, degree > lowest)
        fit = fits[degree]
    return fit, chosen


def _gains(problem: FitProblem, fits: Sequence[Fit]) -> list[float]:
    """Return the evidence for each fit over the first that is usable, one of them at least."""
    usable = [trial for trial in fits if trial.usable]
    effective = problem.independent_samples(min(usable, key=lambda trial: trial.cost))
    gains = []
    for trial in fits:
        more = problem.evidence(usable[0], trial, effective) if trial.usable else -np.inf
        gains.append(0.0 if trial is usable[0] else float(more))
    return gains


def _lowest(gains: Sequence[float]) -> int:
    return next(i for i, gain in enumerate(gains) if gain >= max(gains) - BARE_MENTION)


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
