"""Several explanations of the same records: how probable each is, and what they predict."""

from discover.closed_loop.explanations.beam import BEAM_WIDTH, carry
from discover.closed_loop.explanations.report import explain, with_band
from discover.closed_loop.explanations.telling_apart import next_tests

__all__ = [
    "BEAM_WIDTH",
    "carry",
    "explain",
    "next_tests",
    "with_band",
]
