"""From where the constants of a declared model are fitted, before any effect is added."""

import numpy as np
from scipy.stats import qmc

from discover.closed_loop.search.scoring.attribution import with_other_inner
from discover.forward import AugmentedModel, FreeParameter

_TIMES = (1e-3, 1e-2, 0.1, 0.3, 3.0, 10.0)
"""A relaxation time to be fitted starts at these multiples of its first guess too: from far off its
effect on the stress is flat."""

_FEW, _POINTS = 3, 8
"""Starts of a law with one constant, and with several, spread evenly over their ranges."""


def first_starts(model: AugmentedModel, nothing_known: bool = False) -> list[np.ndarray]:
    """Return parameter vectors to fit the declared model from, the declared values first.

    An unknown relaxation time, several constants of one law, and inner times and exponents of known
    effects may all have a misfit with several minima.

    Parameters
    ----------
    nothing_known
        Whether a law's only constant may be anywhere too, and from where it starts be a place where
        the law cannot be integrated.
    """
    declared = model.declared
    starts = [model.zero()]
    if declared.fit_relaxation_time:
        for factor in _TIMES:
            start = model.zero()
            start[1] = np.log(factor)
            if declared.fit_modulus:
                start[0] = -start[1]  # the viscosity is known better than either
            starts.append(start)
    count = len(declared.free_parameters)
    if count > 1 or (count == 1 and nothing_known):
        # the first of Halton's points is the corner of all lower bounds
        points = _POINTS if count > 1 else _FEW
        for share in qmc.Halton(count, scramble=False).random(points + 1)[1:]:
            start = model.zero()
            start[2 : 2 + len(share)] = [
                _inside(parameter, at)
                for parameter, at in zip(declared.free_parameters, share, strict=True)
            ]
            starts.append(start)
    return starts + _starts_of_known(model)


def _inside(parameter: FreeParameter, share: float) -> float:
    """Return a value within a range; one that leaves out zero spans orders of magnitude."""
    low, high = parameter.low, parameter.high
    if low > 0.0:
        return low * (high / low) ** share
    return low + (high - low) * share


def _starts_of_known(model: AugmentedModel) -> list[np.ndarray]:
    """Return starts from other inner times and exponents of known effects to be fitted."""
    starts = []
    for known in model.declared.effects:
        if not set(known.free) & {p.name for p in known.effect.parameters[1:]}:
            continue
        fixed = [
            position
            for position, value in zip(model.positions(known.name), known.values, strict=True)
            if value is not None
        ]
        for other in with_other_inner(model, model.zero(), known.effect):
            other[fixed] = model.zero()[fixed]
            starts.append(other)
    return starts
