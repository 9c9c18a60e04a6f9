"""One probabilistic engine: hypotheses, their evidence, what they leave, and their posterior."""

from discover.inference.engine.bands import Band
from discover.inference.engine.posterior import Indistinguishable, Posterior
from discover.inference.engine.problem import Problem

__all__ = ["Band", "Indistinguishable", "Posterior", "Problem"]
