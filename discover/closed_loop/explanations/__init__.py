"""Several explanations of the same records: how probable each is, and what they predict."""

from discover.closed_loop.explanations.bands.wider_intervals import (
    modes_over_explanations,
    over_explanations,
)
from discover.closed_loop.explanations.beam import BEAM_WIDTH, Carried, carry_and_turn
from discover.closed_loop.explanations.other_benches import FACTORS, OtherBench, other_benches
from discover.closed_loop.explanations.other_constants import weighed_constants
from discover.closed_loop.explanations.proposed_tests import next_tests
from discover.closed_loop.explanations.report import explain, with_band
from discover.closed_loop.explanations.untested import why_untested

__all__ = [
    "BEAM_WIDTH",
    "FACTORS",
    "Carried",
    "OtherBench",
    "carry_and_turn",
    "explain",
    "modes_over_explanations",
    "next_tests",
    "other_benches",
    "over_explanations",
    "weighed_constants",
    "why_untested",
    "with_band",
]
