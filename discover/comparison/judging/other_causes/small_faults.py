"""Intervals and bands of the sparse law that allow for faults of reading too small to be seen.

An interval that allows for noise alone takes the instrument for exact (see
`discover.statistics.reading.small_faults`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from discover.comparison.judging.as_predicted import SPARSE
from discover.comparison.judging.moved_law import MovedLaw
from discover.comparison.outcomes.constant import Constant
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.identify.rivals.bands import PredictionBand
from discover.statistics import root_of
from discover.statistics.reading.reading_faults import Reading
from discover.statistics.reading.small_faults import HALF_BAND, Allowance, small_faults
from discover.study.declared_model import MODE_CONSTANTS


def holding_small_faults(
    outcomes: Mapping[str, LearnerOutcome],
    bands: Mapping[str, PredictionBand],
    law: MovedLaw,
    flows: Sequence[Flow],
    fitted: Sequence[Reading],
    loading: float = 0.0,
) -> tuple[dict[str, LearnerOutcome], dict[str, PredictionBand]]:
    """Return outcomes and bands that hold with small faults of reading too, to first order.

    Parameters
    ----------
    outcomes
        By learner, of which the sparse law's intervals get wider.
    bands
        Of its law, by the key of the flow.
    law
        The same law, with the constants that were fitted along.
    flows
        In which it is simulated.
    fitted
        The fitted runs as it predicts them.
    loading
        Relative error of one run as repeats tell it; 0 without any.
    """
    allowance = small_faults(fitted, loading)
    if allowance is None or not np.all(np.isfinite(allowance.covariance)):
        return dict(outcomes), dict(bands)
    wider = dict(bands)
    for flow in flows:
        if flow.key in bands:
            told = law.derivatives(flow)
            if told is not None:
                wider[flow.key] = _wider(bands[flow.key], told[1], allowance)
    sparse = outcomes.get(SPARSE)
    if sparse is None:
        return dict(outcomes), wider
    return {**outcomes, SPARSE: _with_intervals(sparse, law, allowance)}, wider


def _wider(
    band: PredictionBand, slopes: Float[np.ndarray, "q n 3"], allowance: Allowance
) -> PredictionBand:
    """Return a band that allows for small faults as well as for what it allows for already."""
    moved = np.einsum("q,qnc->nc", allowance.steps, slopes)
    directions = np.einsum("qr,qnc->rnc", root_of(allowance.covariance), slopes)
    spread = HALF_BAND**2 * np.sum(directions**2, axis=0)
    middle = band.chosen + moved

    def ends(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        # what is not a number stays so: no band stays no band
        below = middle - np.sqrt((band.chosen - low) ** 2 + spread)
        above = middle + np.sqrt((high - band.chosen) ** 2 + spread)
        return np.minimum(low, below), np.maximum(high, above)

    low, high = ends(band.low, band.high)
    rivals_low, rivals_high = ends(band.rivals_low, band.rivals_high)
    return replace(band, low=low, high=high, rivals_low=rivals_low, rivals_high=rivals_high)


def _with_intervals(outcome: LearnerOutcome, law: MovedLaw, allowance: Allowance) -> LearnerOutcome:
    """Return the outcome with intervals of coefficients and constants that allow for them."""
    terms = []
    for i, term in enumerate(outcome.terms, start=len(law.names)):
        if term.ci95 is not None:
            wider = allowance.holding(i, term.coefficient, *term.ci95)
            term = replace(term, ci95=wider)
        terms.append(term)
    constants = dict(outcome.constants)
    for i, name in enumerate(law.names):
        if name in constants:
            constants[name] = _constant(constants[name], i, allowance)
    return replace(outcome, terms=tuple(terms), constants=constants)


def _constant(constant: Constant, position: int, allowance: Allowance) -> Constant:
    if constant.ci95 is None:
        return constant
    low, high = constant.ci95
    if constant.name not in MODE_CONSTANTS:
        return replace(constant, ci95=allowance.holding(position, constant.value, low, high))
    if min(low, constant.value) <= 0.0:
        return constant
    # a modulus or a time moves by a factor
    ratios = np.log(np.array([low, high]) / constant.value)
    low, high = constant.value * np.exp(allowance.holding(position, 0.0, *map(float, ratios)))
    return replace(constant, ci95=(float(low), float(high)))
