"""The verdict on a closed loop in words: what was found, and how sure."""

from discover.loop.loop_result import LoopResult
from discover.report.loop.certainty import how_sure
from discover.report.loop.found import what_was_found


def loop_verdict(result: LoopResult) -> list[str]:
    """Return the verdict on a closed loop: an answer to each of `QUESTIONS`, in order."""
    return [what_was_found(result), how_sure(result)]
