"""Effects of which the records show only a limit, which has another name too."""

from collections.abc import Sequence

import numpy as np

from discover.forward import AugmentedModel


def names_of_limits(
    model: AugmentedModel, theta: np.ndarray, names: Sequence[str], longest: float
) -> dict[str, str]:
    """Return what effects cannot be told from, by name of the effect.

    A structure that builds up in a time that no run lasts is seen to break only: what it does is a
    damping by strain, and that it ever builds up, which the effect's name says, is not determined.

    Parameters
    ----------
    model, theta
        The model and the parameters.
    names
        Effects that are asked for.
    longest
        Length of the longest run in s; zero where all is steady, which tells no time.
    """
    return {
        effect.name: parameter.endless
        for effect in model.effects
        if effect.name in names
        for parameter, at in zip(effect.parameters, model.positions(effect.name), strict=True)
        if parameter.endless and theta[at] >= longest > 0.0
    }
