"""Fitted values held against the ranges that they can have in a laboratory.

A value that a fit drives to the end of its range says that the data ask for something else, and a
constant that is open over decades says nothing: neither is a finding.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from discover.effects import EffectParameter
from discover.forward import AugmentedModel
from discover.inference.problem import effect_of

_TOLERANCE = 1e-3
"""Relative distance from an end at which a fit has stopped there: what a fit leaves of its last
step (a thousandth of the misfit, `RANKING`) moves no value by more that is held at an end."""

_DECADES = 2.0
"""Decades on either side over which the interval of an inner constant may reach. Records tell a
time from some decades only, about one beyond each end of their own window   [Davies & Anderssen
1997, J. Non-Newtonian Fluid Mech. 73, 163], so an interval of four is no determination at all."""


def at_an_end(model: AugmentedModel, theta: np.ndarray, names: Sequence[str]) -> str:
    """Return in a sentence which parameter stands at an end of its range; empty if none does.

    An amplitude at zero is no matter of a range; see `drop_undecided`.
    """
    for name in names:
        effect = effect_of(model, name)
        for parameter, at in zip(effect.parameters, model.positions(name), strict=True):
            value, low, high = theta[at], model.low[at], model.high[at]
            stopped = "high" not in parameter.ends and _reached(value, high)
            inner = parameter is not effect.parameters[0] or low != 0.0
            stopped |= inner and "low" not in parameter.ends and _reached(value, low)
            if stopped:
                return (
                    f"{name} would need {_said(parameter, value)}, the end of what is possible "
                    f"({low:.3g} to {high:.3g}: {parameter.range_source})"
                )
    return ""


def undetermined(
    model: AugmentedModel,
    theta: np.ndarray,
    bounds: Mapping[int, tuple[float, float]],
    name: str,
    longest: float,
) -> str:
    """Return in a sentence which parameter of an effect the data leave open; empty if none.

    Parameters
    ----------
    bounds
        95 % interval of each fitted parameter, by position.
    longest
        Length of the longest run in s. A time beyond it that may be endless is known well enough,
        but not from steady states, which know no time: there it is zero.
    """
    effect = effect_of(model, name)
    for parameter, at in zip(effect.parameters, model.positions(name), strict=True):
        value, (below, above) = theta[at], bounds[at]
        low, high = model.low[at], model.high[at]
        amplitude = parameter is effect.parameters[0]
        endless = "high" in parameter.ends
        if endless and parameter.unit == "s" and value >= longest > 0.0:
            continue
        touches = not endless and _reached(above, high)
        # an amplitude may be small and is then dropped; an inner constant is known from one side
        # at least
        if low < 0.0:
            touches |= _reached(below, low)
        elif not amplitude:
            touches &= below <= low or _reached(below, low)
        # symmetric in the logarithm, the interval reaches as far as its upper half
        half = max(above - value, value - below)
        wide = not amplitude and low > 0.0 and half > value * np.log(10.0**_DECADES)
        if touches or wide:
            return (
                f"{name} is left open: {_said(parameter, value)} may be {below:.3g} to "
                f"{above:.3g}, of the {low:.3g} to {high:.3g} that are possible"
            )
    return ""


def _reached(value: float, end: float) -> bool:
    return bool(np.isfinite(end) and abs(value - end) <= _TOLERANCE * abs(end))


def _said(parameter: EffectParameter, value: float) -> str:
    return f"{parameter.name} = {value:.3g} {parameter.unit}".rstrip()
