"""What bands say over all flows: how wide they are, what stands outside, and where none ends."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from discover.comparison.judging.identifiability import SEPARATED
from discover.comparison.outcomes.flows import QUANTITIES, Flow
from discover.identify.rivals.bands import PredictionBand
from discover.words import listed

WIDEST = 1.0
"""Half of a band over the quantity, from which on it says nothing of it."""

IN_NOISE = 2.0
"""A measurement may stand off a band by so many times the noise of the records."""

_MOST_TITLES = 3


@dataclass(frozen=True)
class BandCheck:
    """What a band says of a quantity, over the flows that were looked at.

    Attributes
    ----------
    half_width
        Half of the widest band over the prediction's norm, N2's over that of N1; None without a
        band.
    missed
        Title of a flow whose truth or measurement stands outside the band; empty if none does.
    off
        How far outside, root-mean-square over that of the reference.
    """

    half_width: float | None
    missed: str = ""
    off: float = 0.0

    @property
    def holds(self) -> bool:
        """Whether there is a band that is narrower than the quantity and that nothing refutes."""
        return self.half_width is not None and self.half_width < WIDEST and not self.missed


def check_band(
    quantity: str,
    flows: Sequence[Flow],
    bands: Mapping[str, PredictionBand],
    noise: float,
) -> BandCheck:
    """Return how wide the bands of a quantity are, and whether what is known lies inside."""
    column = QUANTITIES.index(quantity)
    relative_to = QUANTITIES.index("N1") if quantity == "N2" else column
    half_width, missed, off = None, "", 0.0
    for flow in flows:
        band = bands.get(flow.key)
        # of moduli there is no normal stress to have a band: that of zeros would hold them all
        if band is None or not np.any(band.chosen[:, relative_to]):
            continue
        width = 0.5 * band.widths()[quantity]
        half_width = max(half_width or 0.0, width if np.isfinite(width) else np.inf)
        reference = flow.reference.get(quantity)
        scale = flow.reference.get("N1" if quantity == "N2" else quantity)
        size = 0.0 if scale is None else float(np.linalg.norm(scale))
        if reference is None or size == 0.0:
            continue
        low, high = band.rivals_low[:, column], band.rivals_high[:, column]
        outside = float(np.linalg.norm(reference - np.clip(reference, low, high))) / size
        allowed = SEPARATED if flow.is_truth else max(SEPARATED, IN_NOISE * noise)
        if not outside <= allowed and outside > off:
            missed, off = flow.title, outside
    return BandCheck(half_width, missed, off)


def unbounded(flows: Sequence[Flow], bands: Mapping[str, PredictionBand]) -> str:
    """Return in which flows no band of σ12 has an end, in a sentence; empty if in none."""
    titles = [
        flow.title
        for flow in flows
        if flow.in_shear
        and (band := bands.get(flow.key)) is not None
        and not np.isfinite(band.widths()["sigma12"])
    ]
    if not titles:
        return ""
    more = len(titles) - _MOST_TITLES
    shown = titles if more <= 0 else [*titles[:_MOST_TITLES], f"{more} more"]
    return (
        f"In {listed(shown)} too many laws within the parameters' intervals run away, so "
        "no band says how far σ12 could lie from that shown."
    )
