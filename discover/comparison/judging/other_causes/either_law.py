"""Intervals and bands that hold for the law found and for the same law with other coefficients."""

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from discover.comparison.judging.as_predicted import SPARSE
from discover.comparison.outcomes.flows import QUANTITIES
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.identify.rivals.bands import PredictionBand


def intervals_of_either(
    outcomes: Mapping[str, LearnerOutcome],
    coefficients: Float[np.ndarray, " terms"],
    without: Collection[str] = (),
) -> dict[str, LearnerOutcome]:
    """Return the outcomes, intervals of the sparse law holding other coefficients, as widely, too.

    Parameters
    ----------
    outcomes
        By learner.
    coefficients
        In the order of its terms.
    without
        Terms, by their spelling, that are zero in the other law and not uncertain.
    """
    sparse = outcomes.get(SPARSE)
    if sparse is None:
        return dict(outcomes)
    other = {}
    for term, value in zip(sparse.terms, map(float, coefficients), strict=True):
        half = 0.0
        if term.ci95 is not None and term.term not in without:
            half = 0.5 * (term.ci95[1] - term.ci95[0])
        other[term.term] = value, value - half, value + half
    return intervals_of_other(outcomes, other)


def intervals_of_other(
    outcomes: Mapping[str, LearnerOutcome],
    coefficients: Mapping[str, tuple[float, float, float]],
) -> dict[str, LearnerOutcome]:
    """Return the outcomes, intervals of the sparse law holding those of another law, too.

    Parameters
    ----------
    outcomes
        By learner.
    coefficients
        Of the other law: value, and ends of the interval, by the spelling of the term; a term that
        it lacks is zero.
    """
    sparse = outcomes.get(SPARSE)
    if sparse is None:
        return dict(outcomes)
    terms = []
    for term in sparse.terms:
        one = term
        if term.ci95 is not None:
            _, low, high = coefficients.get(term.term, (0.0, 0.0, 0.0))
            one = replace(term, ci95=(min(term.ci95[0], low), max(term.ci95[1], high)))
        terms.append(one)
    return {**outcomes, SPARSE: replace(sparse, terms=tuple(terms))}


def bands_of_either(
    bands: Mapping[str, PredictionBand], predictions: Mapping[str, Mapping[str, np.ndarray] | None]
) -> dict[str, PredictionBand]:
    """Return bands of the sparse law that hold another one, as widely, too.

    Parameters
    ----------
    bands
        By the key of the flow.
    predictions
        Of the other law, by the same key; None where it runs away.
    """
    limits = {}
    for key, band in bands.items():
        predicted = predictions.get(key)
        if predicted is not None:
            moved = np.stack([predicted[q] for q in QUANTITIES], axis=-1) - band.chosen
            limits[key] = band.rivals_low + moved, band.rivals_high + moved
    return bands_within(bands, limits)


def bands_within(
    bands: Mapping[str, PredictionBand],
    limits: Mapping[str, tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]]],
) -> dict[str, PredictionBand]:
    """Return bands of the sparse law that hold all between other limits, too.

    Parameters
    ----------
    bands
        By the key of the flow.
    limits
        Lowest and highest σ12, N1 and N2 of another law, by the same key.
    """
    wider = {}
    for key, band in bands.items():
        low, high = limits.get(key, (band.rivals_low, band.rivals_high))
        wider[key] = replace(
            band,
            rivals_low=np.minimum(band.rivals_low, low),
            rivals_high=np.maximum(band.rivals_high, high),
        )
    return wider
