"""One probabilistic engine: hypotheses, their evidence, what they leave, and their posterior."""

from discover.inference.engine.bands import Band
from discover.inference.engine.indistinguishable import Indistinguishable
from discover.inference.engine.posterior import Posterior
from discover.inference.engine.problem import Problem

__all__ = ["Band", "Indistinguishable", "Posterior", "Problem"]
