"""Constants of a law that differ from mode to mode, to be held against names that were found.

A declared law has the same constants in every mode, and real fluids do not: what that leaves of the
data looks like a little of many effects. It is no candidate, since it names no mechanism; but a
name that is not needed once it is allowed is no finding.
"""

from collections.abc import Sequence
from dataclasses import replace

from discover.effects import ModeDependence
from discover.inference.evidence import INDISTINGUISHABLE
from discover.inference.least_squares import Fit
from discover.inference.problem import FitProblem

_STARTS = (-0.5, 0.5)


def names_not_needed(problem: FitProblem, fit: Fit, names: Sequence[str]) -> tuple[str, ...]:
    """Return the effects without which the data are explained as well, by constants by mode.

    Each is left out alone, and with all that came after it; the exponent of the modes is then
    fitted in their place. They are not needed if the evidence for them over it is not strong
    (`INDISTINGUISHABLE`).

    Parameters
    ----------
    problem, fit
        What is fitted to what, and the fit. Without a `ModeDependence` among the effects nothing is
        said.
    names
        Effects that may go, in the order in which they came.
    """
    by_mode = next((e for e in problem.model.effects if isinstance(e, ModeDependence)), None)
    if by_mode is None or not names:
        return ()
    groups = list(dict.fromkeys([*(tuple(names[i:]) for i in range(len(names))), *zip(names)]))
    at = problem.model.positions(by_mode.name)
    starts, free, owners = [], [], []
    for group in groups:
        for exponent in _STARTS:
            theta, rest = problem.without(fit, *group)
            theta[at] = exponent
            starts.append(theta)
            free.append((*rest, *at))
            owners.append(group)
    rivals = problem.fits(starts, free, rivals=True)
    effective = problem.independent_samples(fit)
    # both are fitted here, and neither pays for a choice among many
    alone = replace(problem, n_candidates=1)
    enough = [
        group
        for group, rival in zip(owners, rivals, strict=True)
        if rival.usable and alone.evidence(rival, fit, effective) <= INDISTINGUISHABLE
    ]
    return max(enough, key=len, default=())
