"""The instrument as part of what is known in a comparison: with its values, or fitted along."""

from discover.comparison.instrument.absorbed import absorbed
from discover.comparison.instrument.classical_along import classical_along
from discover.comparison.instrument.corrected import corrected
from discover.comparison.instrument.fitted_along import FittedAlong, Learned
from discover.comparison.instrument.fixed import fixed_with_the_law
from discover.comparison.instrument.frame import Frame

__all__ = [
    "FittedAlong",
    "Frame",
    "Learned",
    "absorbed",
    "classical_along",
    "corrected",
    "fixed_with_the_law",
]
