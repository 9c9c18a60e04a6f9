"""The verdict on a comparison: what was found, how sure, what to measure next."""

from discover.comparison.comparison import Comparison
from discover.report.comparison.certainty import how_sure
from discover.report.comparison.found import what_was_found
from discover.report.comparison.next_step import what_to_measure_next


def comparison_verdict(comparison: Comparison) -> list[str]:
    """Return the verdict on a comparison: an answer to each of `QUESTIONS`, in order."""
    return [what_was_found(comparison), how_sure(comparison), what_to_measure_next(comparison)]
