"""Intervals of constants of a fit that allow for faults of reading too small to be seen."""

from collections.abc import Mapping

from discover.forward import AugmentedModel
from discover.inference.least_squares import Fit
from discover.statistics.reading.small_faults import Allowance


def with_small_faults(
    bounds: Mapping[int, tuple[float, float]],
    fit: Fit,
    model: AugmentedModel,
    small: Allowance | None,
) -> dict[int, tuple[float, float]]:
    """Return intervals that allow for small faults, inside the ranges of their constants.

    Parameters
    ----------
    bounds
        95 % intervals by position, for noise alone.
    fit, model
        The fit, and the model that it is of.
    small
        What the faults leave open, in the order of what was fitted; None for nothing.
    """
    wider = dict(bounds)
    if small is None:
        return wider
    for i, position in enumerate(fit.free):
        if position in bounds:
            low, high = small.holding(i, float(fit.theta[position]), *bounds[position])
            ends = float(model.low[position]), float(model.high[position])
            wider[position] = max(low, ends[0]), min(high, ends[1])
    return wider
