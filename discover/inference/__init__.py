"""One probabilistic engine: hypotheses, their evidence, what they leave, and their posterior."""

from discover.inference.bands import Band
from discover.inference.indistinguishable import Indistinguishable
from discover.inference.posterior import Posterior
from discover.inference.problem import Problem

__all__ = ["Band", "Indistinguishable", "Posterior", "Problem"]
