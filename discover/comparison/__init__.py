"""Two learners on identical data: what each found, how well it predicts, what stays open."""

from discover.comparison.comparison import Comparison
from discover.comparison.flows import Flow, relative_errors
from discover.comparison.outcome import LearnerOutcome
from discover.comparison.run_comparison import compare

__all__ = ["Comparison", "Flow", "LearnerOutcome", "compare", "relative_errors"]
