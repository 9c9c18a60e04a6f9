"""How far N1 and N2 move between the laws of a page that describe σ12 about as well."""

from collections.abc import Mapping, Sequence

import numpy as np

from discover.comparison.judging.identifiability import Rival
from discover.comparison.outcomes.flows import Flow, Stresses, relative_errors
from discover.comparison.outcomes.outcome import LearnerOutcome

_ABOUT_AS_WELL = 2.0
"""A law that leaves so many times what the best one does describes the runs about as well."""


def room_left(
    outcomes: Mapping[str, LearnerOutcome],
    misfits: Mapping[str, float],
    rivals: Sequence[Rival],
    flows: Sequence[Flow],
) -> dict[str, float]:
    """Return the largest relative difference of N1 and N2 between laws that fit about as well.

    N2's is relative to N1. A quantity of which no two laws tell is left out.

    Parameters
    ----------
    outcomes
        What each learner found; members of the network count as laws of their own.
    misfits
        What each learner's law leaves of the fitted runs.
    rivals
        Laws that the data do not tell from the sparse one.
    flows
        The flows of the page in shear.
    """
    finite = {name: misfit for name, misfit in misfits.items() if np.isfinite(misfit)}
    limit = _ABOUT_AS_WELL * min(finite.values(), default=0.0)
    fitting = [outcomes[name] for name, misfit in finite.items() if misfit <= limit]
    found: dict[str, float] = {}

    def note(quantity: str, size: float | None) -> None:
        if size is not None and np.isfinite(size):
            found[quantity] = max(found.get(quantity, 0.0), size)

    for flow in (flow for flow in flows if flow.in_shear):
        told = [law for one in fitting if (law := one.predictions.get(flow.key)) is not None]
        for i, law in enumerate(told):
            for other in told[:i]:
                for quantity, size in _apart(law, other).items():
                    note(quantity, size)
        for one in fitting:
            widths = one.half_widths(flow) if one.learner == "tbnn_ude" else {}
            for quantity in ("N1", "N2"):
                note(quantity, None if quantity not in widths else 2.0 * widths[quantity])
    if any(one.learner == "tensor_sindy" for one in fitting):
        for rival in rivals:
            for quantity in ("N1", "N2"):
                note(quantity, rival.errors_to_chosen.get(quantity))
    return found


def _apart(law: Stresses, other: Stresses) -> dict[str, float | None]:
    errors = relative_errors(law, other)
    return {quantity: errors[quantity] for quantity in ("N1", "N2")}
