"""Flows that are left to test an explanation, where none is held out.

A constant takes a flow to show itself. Flows beyond those that the constants of an explanation take
were a trial that it passed. Of something that passed all of m trials the next succeeds with
probability (m + 1)/(m + 2), by Laplace's rule of succession: one half, where nothing was tried.
"""

from collections.abc import Sequence

from discover.dataset import Run
from discover.dataset.repeats import count_flows
from discover.forward import AugmentedModel


def flows_left(
    model: AugmentedModel, fitted: Sequence[Run], effects: Sequence[str], any_fitted: bool
) -> int:
    """Return how many of the fitted flows are more than the constants of a set of effects take.

    Constants of the declared model, which any flow shows, take one flow together.

    Parameters
    ----------
    model
        With all candidates.
    fitted
        The runs.
    effects
        Names.
    any_fitted
        Whether anything of the model was fitted.
    """
    taken = sum(len(model.positions(name)) for name in effects)
    return max(count_flows(fitted) - max(taken, int(any_fitted)), 0)


def share_left(left: int) -> float:
    """Return how far an explanation is to be believed that passed the test of so many flows."""
    return (left + 1) / (left + 2)
