"""Another law in one mode alone, where the same one in all modes explains the runs.

Of a mode that the flow hardly stretches records tell how large the first departure from linear
viscoelasticity is, and not of which law it is.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from discover.forward.by_mode import DEGREE, LARGEST
from discover.inference.evidence import INDISTINGUISHABLE
from discover.inference.least_squares import Fit
from discover.inference.problem import FitProblem
from discover.words import listed, plainly

ONE_CONSTANT = ("giesekus_mobility", "ptt_linear", "non_affine_motion")
"""The classical laws with one constant by mode, between which slow flows do not decide."""


def laws_as_good(problem: FitProblem, same: Fit, name: str, mode: int) -> dict[str, Fit]:
    """Return fits of other laws in one mode that describe the runs as well, by their name.

    As well as that whose constant is free in this mode: both have one constant more.

    Parameters
    ----------
    problem
        With every effect of `ONE_CONSTANT` by mode.
    same
        The fit of one law with the same constant in all modes, and of what else is free.
    name
        Of the effect that is this law.
    mode
        Position of the mode.
    """
    forward = problem.model
    amplitude = forward.positions(name)[0]
    deviations = forward.varying(name)[DEGREE:]
    own = problem.fit(same.theta, [*same.free, deviations[mode]])
    own = own if own.usable and problem.cost(own) < problem.cost(same) else same
    effective = problem.independent_samples(own)
    found = {}
    for other in ONE_CONSTANT:
        if other == name:
            continue
        start = same.theta.copy()
        start[deviations[mode]] = -LARGEST
        at = forward.positions(other)[0]
        start[at] = same.theta[amplitude]
        elsewhere = np.delete(forward.varying(other)[DEGREE:], mode)
        start[elsewhere] = -LARGEST
        fit = problem.fit(start, [*same.free, at])
        if not fit.usable:
            continue
        # of the same number of constants
        behind = effective * np.log(problem.cost(fit) / problem.cost(own))
        if behind < INDISTINGUISHABLE:
            found[other] = fit
    return found


def other_laws_said(names: Mapping[float, Sequence[str]]) -> str:
    """Return what is not determined of modes, by relaxation time in s; empty if nothing."""
    alike: dict[tuple[str, ...], list[float]] = {}
    for time, others in sorted(names.items()):
        alike.setdefault(tuple(others), []).append(time)
    text = ""
    for others, times in alike.items():
        modes = f"mode{'s' * (len(times) > 1)} of {listed([plainly(one) for one in times])} s"
        where = "one of them" if len(times) > 1 else "it"
        text += (
            f" The law of the {modes} is not determined by these data: with "
            f"{' or '.join(others)} in {where} alone they are described as well."
        )
    return text
