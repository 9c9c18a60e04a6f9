"""Fits that nothing tested: of one flow, or of states alone."""

from collections.abc import Sequence
from typing import Literal

from discover.dataset import Run
from discover.dataset.repeats import is_one_flow
from discover.forward.least_squares import Fit
from discover.protocols.kinematics import STATES

Untested = Literal["one_flow", "states"]
"""Why nothing tested a fit: there is one flow, or there are steady or periodic states alone."""

NEVER_TRIED = 0.5
"""Share of the explanations where nothing tested them: the next trial of what was never tried
succeeds with probability (0 + 1)/(0 + 2), by Laplace's rule of succession."""


def why_untested(fit: Fit, fitted: Sequence[Run], held_out: Sequence[Run]) -> Untested | None:
    """Return why nothing that was measured could have refuted what was fitted; None if it could.

    States do not tell how they are reached: a viscosity η₀/(1 + q γ̇) is that of a structure that
    flow breaks down, and as well one of White and Metzner.

    Parameters
    ----------
    fit
        The final fit; a model of which nothing was fitted was tested by any run.
    fitted, held_out
        The runs.
    """
    if not fit.free:
        return None
    if all(run.protocol.control in STATES for run in (*fitted, *held_out)):
        return "states"
    return "one_flow" if not held_out and is_one_flow(fitted) else None
