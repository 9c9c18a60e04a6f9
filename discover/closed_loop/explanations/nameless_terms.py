"""Terms of the library that no law with a name has by itself: how far one is to be believed.

In the flows that were run the first terms of a law that nobody wrote down follow it to within the
noise, and so does a term that is all that is missing. The records do not tell these apart, and no
law of a real fluid is known to be one such term, so one is no likelier than not: half of its
probability is that of none of the explanations.
"""

from collections.abc import Sequence

from discover.effects import LibraryTerm
from discover.forward import AugmentedModel

_CONSTANTS = ("sigma", "gammadot")
"""Terms that are another relaxation time, and another modulus."""

_EVEN = 0.5


def share_of_names(model: AugmentedModel, effects: Sequence[str]) -> float:
    """Return how far a set of effects is to be believed, by whether all in it has a name.

    Parameters
    ----------
    model
        With all candidates.
    effects
        Names of those in the set.
    """
    nameless = {
        effect.name
        for effect in model.effects
        if isinstance(effect, LibraryTerm) and effect.name not in _CONSTANTS
    }
    return _EVEN if nameless.intersection(effects) else 1.0
