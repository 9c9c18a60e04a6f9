"""Intervals of constants that hold whichever of the explanations is the right one."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.optimize import brentq
from scipy.stats import norm

from discover.closed_loop.explanations.beam import Carried
from discover.closed_loop.explanations.other_constants import OtherConstants
from discover.closed_loop.explanations.proposed_tests import contenders
from discover.closed_loop.results.explanation import Explanations
from discover.forward import AugmentedModel
from discover.inference.by_mode.constants import ConstantByMode
from discover.inference.by_mode.degrees import Degree
from discover.inference.by_mode.varying_constant import varying_constants
from discover.inference.least_squares import Fit

Bounds = Mapping[int, tuple[float, float]]

_LEVELS = (0.025, 0.975)
_HALF = float(norm.ppf(_LEVELS[1]))

_EXACT = ((0.0, 1.0),)
_NORMAL = ((-(3.0**0.5), 1 / 6), (0.0, 2 / 3), (3.0**0.5, 1 / 6))
"""Deviations of a normal distribution and their weights, by Gauss's and Hermite's rule."""


def over_explanations(
    bounds: Bounds,
    model: AugmentedModel,
    fit: Fit,
    carried: Sequence[Carried],
    explanations: Explanations,
    other: Sequence[tuple[OtherConstants, float]] = (),
) -> dict[int, tuple[float, float]]:
    """Return 95 % intervals of constants over all explanations that have them.

    An interval beside one set of effects takes that set for granted. With another, or with a twin
    of one effect that leaves these records alike, the same constant often has another value. Each
    explanation counts with its probability, and with the width of the interval that is given and
    what faults of a bench leave open beside it; the given interval always lies within.

    Parameters
    ----------
    bounds
        Intervals by position, given the effects of the fit.
    model, fit
        With all candidates; what the search ended with.
    carried, explanations
        Sets of effects, and how probable each is.
    other
        Sets of effects beside other declared constants, and how much likelier each is than what was
        found: with a shorter time a coefficient is smaller by the same factor.
    """
    weighed = contenders(carried, explanations)
    found = dict(bounds)
    own = {at: effect.name for effect in model.effects for at in model.positions(effect.name)}
    for at, (low, high) in bounds.items():
        having = [
            (one.fit.theta[at] + off * one.left_open.get(at, 0.0), weight * share)
            for one, weight in weighed
            if at not in own or own[at] in one.effects
            for off, share in (_NORMAL if at in one.left_open else _EXACT)
        ]
        # of what was found the weight is the largest, or another would have been found
        most = max((weight for _, weight in having), default=0.0)
        having += [
            (one.theta[at], most * odds)
            for one, odds in other
            if at in own and own[at] in one.effects
        ]
        if having:
            values, weights = np.array(having, dtype=float).T
            within = float(model.low[at]), float(model.high[at])
            found[at] = _over(float(fit.theta[at]), (low, high), values, weights, within)
    return found


def modes_over_explanations(
    by_mode: Mapping[str, ConstantByMode],
    model: AugmentedModel,
    fit: Fit,
    carried: Sequence[Carried],
    explanations: Explanations,
) -> dict[str, ConstantByMode]:
    """Return constants by mode, the interval of each mode over all explanations that have them.

    Beside a twin of another effect they often have other values: those of a law of Phan-Thien and
    Tanner beside non-affine motion, and beside the term of the library that no shear stress tells
    from it.

    Parameters
    ----------
    by_mode
        By name, given the effects of the fit.
    model, fit, carried, explanations
        As in `over_explanations`.
    """
    found, weighed = dict(by_mode), contenders(carried, explanations)
    effects = {effect.name for effect in model.effects}
    # of modes that were told apart afterwards the model has one constant for all
    told = [name for name in by_mode if name in model.declared.by_mode_slices]
    varying = varying_constants(model, fit, dict.fromkeys(told, Degree()))
    for name, constant in varying.items():
        having = [pair for pair in weighed if name not in effects or name in pair[0].effects]
        if not having:
            continue
        values = np.array([constant.of_modes(one.fit) for one, _ in having])
        weights = np.array([weight for _, weight in having])
        within = constant.law.low, constant.law.high
        modes = tuple(
            mode
            if mode.ci95 is None
            else replace(mode, ci95=_over(mode.value, mode.ci95, column, weights, within))
            for mode, column in zip(by_mode[name].modes, values.T, strict=True)
        )
        found[name] = replace(by_mode[name], modes=modes)
    return found


def _over(
    value: float,
    interval: tuple[float, float],
    values: Float[np.ndarray, " e"],
    weights: Float[np.ndarray, " e"],
    within: tuple[float, float],
) -> tuple[float, float]:
    """Return an interval over explanations with other values, each as wide as the one given."""
    low, high = interval
    if not (low < value < high and np.isfinite([low, high]).all()):
        return interval
    ends = _ends(values, weights / np.sum(weights), value - low, high - value)
    # half a normal distribution may reach beyond the range that is physical
    return min(low, max(ends[0], within[0])), max(high, min(ends[1], within[1]))


def _ends(values, weights, below: float, above: float) -> tuple[float, float]:
    """Return the ends of the interval of a mixture, each of two halves of a normal distribution."""

    def share(x: float) -> float:
        off = x - values
        scaled = _HALF * off / np.where(off < 0.0, below, above)
        return float(np.sum(weights * norm.cdf(scaled)))

    far = 4.0 * max(below, above)
    span = float(np.min(values)) - far, float(np.max(values)) + far
    ends: Any = [brentq(lambda x, level=level: share(x) - level, *span) for level in _LEVELS]
    return float(ends[0]), float(ends[1])
