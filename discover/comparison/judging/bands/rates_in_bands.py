"""Bands that hold what is open of a rate which is the mean of rates read with noise."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from discover.comparison.judging.moved_law import MovedLaw
from discover.comparison.judging.other_causes.bench_flows import faster
from discover.comparison.outcomes.flows import QUANTITIES, Flow, predict
from discover.dataset import Run
from discover.identify.rivals.bands import PredictionBand
from discover.statistics import HALF_BAND


def holding_rate_errors(
    bands: Mapping[str, PredictionBand], law: MovedLaw, flows: Sequence[Flow], runs: Iterable[Run]
) -> dict[str, PredictionBand]:
    """Return bands that allow for the standard error of each run's rate, to first order.

    Parameters
    ----------
    bands
        Of the sparse law, by the key of the flow.
    law
        The same law.
    flows
        In which it is simulated.
    runs
        Of which those have such an error whose rates scatter in their reading alone.
    """
    errors = {run.name: run.rate_error for run in runs if run.rate_error > 0.0}
    found, fluid = dict(bands), law.fluid(law.start)
    for flow in flows:
        error = errors.get(flow.name, 0.0)
        if flow.key not in bands or error == 0.0:
            continue
        told = [predict(fluid, one) for one in (flow, faster(flow, error))]
        columns = [np.stack([one[q] for q in QUANTITIES], axis=-1) for one in told if one]
        if len(columns) == len(told):
            found[flow.key] = _wider(bands[flow.key], HALF_BAND * (columns[1] - columns[0]))
    return found


def _wider(band: PredictionBand, half: np.ndarray) -> PredictionBand:
    low, high = band.ends_with(band.low, band.high, half)
    rivals_low, rivals_high = band.ends_with(band.rivals_low, band.rivals_high, half)
    return replace(band, low=low, high=high, rivals_low=rivals_low, rivals_high=rivals_high)
