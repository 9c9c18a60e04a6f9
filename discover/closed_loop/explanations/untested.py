"""How far what was measured tested an explanation, where no run is held out to do it.

A constant takes a flow to show itself. Flows beyond those that the constants of an explanation take
were a trial that it passed. Of something that passed all of m trials the next succeeds with
probability (m + 1)/(m + 2), by Laplace's rule of succession: one half, where nothing was tried.

States do not tell how they are reached, so however many of them there are, they are no trial: a
viscosity η₀/(1 + q γ̇) is that of a structure that flow breaks down, and as well one of White and
Metzner.
"""

from collections.abc import Sequence
from typing import Literal

from discover.dataset import Run
from discover.dataset.records.repeats import count_flows
from discover.forward import AugmentedModel
from discover.inference.least_squares import Fit
from discover.protocols.kinematics import STATES

Untested = Literal["flows", "states"]
"""Why nothing tested a fit: no flow was left to, or there are steady or periodic states alone."""

Runs = tuple[Sequence[Run], Sequence[Run]]
"""The runs that were fitted, and those held out."""


def why_untested(
    model: AugmentedModel, fit: Fit, effects: Sequence[str], runs: Runs
) -> Untested | None:
    """Return why nothing that was measured could have refuted what was fitted; None if it could.

    Parameters
    ----------
    model
        With all candidates.
    fit, effects
        A fit, and the effects in it. One in which nothing was fitted was tested by any run.
    """
    if not fit.free:
        return None
    if _are_states(runs):
        return "states"
    return None if runs[1] or _flows_left(model, effects, runs[0]) else "flows"


def share_believed(model: AugmentedModel, fit: Fit, effects: Sequence[str], runs: Runs) -> float:
    """Return how far an explanation is to be believed, by the flows that tested it.

    Runs held out are a test by themselves, and the verdict tells what they say.
    """
    if not fit.free or (runs[1] and not _are_states(runs)):
        return 1.0
    left = 0 if _are_states(runs) else _flows_left(model, effects, runs[0])
    return (left + 1) / (left + 2)


def _are_states(runs: Runs) -> bool:
    return all(run.protocol.control in STATES for part in runs for run in part)


def _flows_left(model: AugmentedModel, effects: Sequence[str], fitted: Sequence[Run]) -> int:
    """Return how many flows there are beyond those that the constants of some effects take.

    Constants of the declared model, which any flow shows, take one flow together.
    """
    taken = sum(len(model.positions(name)) for name in effects)
    return max(count_flows(fitted) - max(taken, 1), 0)
