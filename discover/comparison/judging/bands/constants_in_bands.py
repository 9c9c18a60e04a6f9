"""Bands that hold for constants of the declared model that were fitted to the same runs.

The draws of a sparse law vary its coefficients. Where a modulus, a relaxation time or a constant of
the declared law was fitted too, what the runs leave open of it moves the predictions as well, and
where no term was found nothing else does: a band of no width would say that they are exact.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from discover.comparison.judging.moved_law import MovedLaw
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.identify.rivals.bands import PredictionBand
from discover.statistics import HALF_BAND, least_squares_covariance, root_of
from discover.study.declared_model import MODE_CONSTANTS, DeclaredModel


def with_fitted_constants(
    bands: Mapping[str, PredictionBand], law: MovedLaw, flows: Sequence[Flow]
) -> dict[str, PredictionBand]:
    """Return bands no narrower than what constants and coefficients together leave open.

    To first order, from the covariance of both that the fitted runs give.

    Parameters
    ----------
    bands
        Of the sparse law, by the key of the flow.
    law
        The same law, with the constants that were fitted along.
    flows
        The flows in which the law is simulated, those fitted among them.
    """
    training = [flow for flow in flows if flow.kind == "training"]
    if not law.names or not bands or not training:
        return dict(bands)
    told = {flow.key: law.derivatives(flow) for flow in flows if flow.key in bands}
    told |= {flow.key: law.derivatives(flow) for flow in training if flow.key not in told}
    root = _root(training, told)
    if root is None:
        return dict(bands)
    found = dict(bands)
    for key, band in bands.items():
        slopes = told.get(key)
        if slopes is not None:
            found[key] = _wider(band, np.einsum("qr,qnc->rnc", root, slopes[1]))
    return found


def law_with_fitted(
    chosen: LearnerOutcome, declared: DeclaredModel, names: Sequence[str]
) -> MovedLaw:
    """Return the law that a learner found, with those of the constants that were fitted along."""
    return MovedLaw.of(chosen.terms, declared, constants_of(names, declared))


def constants_of(names: Sequence[str], declared: DeclaredModel) -> tuple[str, ...]:
    """Return those of the constants that were fitted that are of the modes or of the law."""
    return tuple(n for n in names if n in MODE_CONSTANTS or n in declared.parameters)


def _root(training: Sequence[Flow], told: Mapping[str, tuple | None]) -> np.ndarray | None:
    """Return a root of the covariance of constants and coefficients that the fitted runs give."""
    design, residual, sequences, sizes, at = [], [], [], [], 0
    for flow in training:
        slopes = told[flow.key]
        if slopes is None or flow.measured is None:
            return None
        record = np.asarray(flow.measured, dtype=float)
        even = flow.even(record)
        # a run counts once, however many samples share it
        weight = even / (float(np.linalg.norm(even * record)) or 1.0)
        predicted, derivatives = slopes
        residual.append(weight * (predicted[:, 0] - record))
        design.append((weight * derivatives[..., 0]).T)
        sequences.append(np.arange(at, at + len(record)))
        sizes.append(1.0 / np.sqrt(len(record)))
        at += len(record)
    covariance, _, _ = least_squares_covariance(
        np.concatenate(design), np.concatenate(residual), sequences, sizes=sizes
    )
    return root_of(covariance) if np.all(np.isfinite(covariance)) else None


def _wider(band: PredictionBand, directions: Float[np.ndarray, "r n 3"]) -> PredictionBand:
    """Return a band that holds what moves along all of these directions, each of unit variance."""
    half = HALF_BAND * np.sqrt(np.sum(directions**2, axis=0))
    low, high = band.chosen - half, band.chosen + half
    # np.minimum keeps what is not a number: no band stays no band
    return replace(
        band,
        low=np.minimum(band.low, low),
        high=np.maximum(band.high, high),
        rivals_low=np.minimum(band.rivals_low, low),
        rivals_high=np.maximum(band.rivals_high, high),
        directions=directions[..., 0],
    )
