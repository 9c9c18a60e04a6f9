"""The verdict on a closed loop: what was found, how sure, what to measure next."""

from discover.loop.loop_result import LoopResult
from discover.loop.next_test import what_to_measure_next
from discover.report.loop.certainty import how_sure
from discover.report.loop.found import what_was_found


def loop_verdict(result: LoopResult) -> list[str]:
    """Return the verdict on a closed loop: an answer to each of `QUESTIONS`, in order."""
    return [what_was_found(result), how_sure(result), what_to_measure_next(result)]
