"""Bands of N1 and N2 that hold one term more of the library, as large as the noise lets it be."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from discover.comparison.judging.identifiability import law_structure
from discover.comparison.outcomes.flows import QUANTITIES, Flow
from discover.identify import Structure
from discover.identify.rivals.bands import PredictionBand
from discover.statistics import LackOfFit

_N1 = QUANTITIES.index("N1")


def holding_one_term_more(
    bands: Mapping[str, PredictionBand],
    structure: Structure | None,
    left: LackOfFit,
    flows: Sequence[Flow],
) -> dict[str, PredictionBand]:
    """Return bands of N1 and N2, wider by what one term more leaves open beside the law.

    That is known over the fitted runs, relative to N1 (`OneTermMore`). In another flow it grows as
    the band of N1 does.

    Parameters
    ----------
    bands
        Of the law and its rivals, by the key of the flow.
    structure
        What the fitted runs can tell at the law found.
    left
        What the law leaves of them: their noise.
    flows
        The flows.
    """
    at = law_structure(structure)
    if at is None or not at.one_more:
        return dict(bands)
    noise = _of_few(left)
    fitted = [
        bands[flow.key].widths()["N1"]
        for flow in flows
        if flow.kind == "training" and flow.key in bands
    ]
    usual = float(np.mean(fitted)) if fitted else 0.0
    found = {}
    for key, band in bands.items():
        growth = max(1.0, band.widths()["N1"] / usual) if usual > 0.0 else 1.0
        more = np.zeros_like(band.chosen)
        for column, quantity in enumerate(QUANTITIES):
            if quantity in at.one_more:
                moved = at.one_more[quantity].per_noise * noise * growth
                more[:, column] = moved * np.abs(band.chosen[:, _N1])
        low, high = band.ends_with(band.rivals_low, band.rivals_high, more)
        found[key] = replace(band, rivals_low=low, rivals_high=high)
    return found


def _of_few(left: LackOfFit) -> float:
    """Return the noise, larger by as much as its samples are fewer that are independent."""
    correlation = float(np.clip(left.lag_one_correlation, 0.0, 0.95))
    return left.noise * float(np.sqrt((1.0 + correlation) / (1.0 - correlation)))
