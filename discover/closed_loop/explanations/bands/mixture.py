"""What several explanations predict together, as a band."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy.special import ndtri
from scipy.stats import t as student

from discover.closed_loop.explanations.bands.discrepancy import discrepancy, signatures
from discover.closed_loop.explanations.bands.growth import growth
from discover.closed_loop.explanations.bands.widening import widening
from discover.closed_loop.explanations.beam import Carried
from discover.closed_loop.judging.held_out import root_of_covariance
from discover.forward import AugmentedModel, Batch
from discover.inference.least_squares import Fit
from discover.inference.modulus_errors import modulus_shifts, response
from discover.statistics.mixed_normals import quantile
from discover.statistics.projection import rms

_TAILS = (0.025, 0.975)


def mixed_bands(
    model: AugmentedModel,
    fitted: Batch,
    carried: Sequence[Carried],
    probabilities: Sequence[float],
    batches: Sequence[Batch],
    noise: float,
    structured: bool,
    candidates: Sequence[str],
    rates: Sequence[Float[np.ndarray, " _"]],
) -> list[Float[np.ndarray, "2 runs n"]]:
    """Return where 95 % of the measurements should lie, were it one of the explanations.

    Each explanation gives a normal distribution about its prediction, as wide as its constants are
    uncertain and as what it leaves of the fitted runs, and wider where that does not hold each of
    those that is left out in turn (`widening`); they are mixed by their probabilities.

    Parameters
    ----------
    carried, probabilities
        The explanations, and how probable each is.
    batches
        Runs to predict; what was fitted may be one of them.
    noise
        Relative noise of a measurement.
    structured
        Whether what they leave of the fitted runs is more than noise. A run shares it, so that as
        many runs say how large it is in another one, and the tails are Student's.
    candidates
        Effects that an explanation may still lack; see `discrepancy`.
    rates
        Largest rate of each run, of those that were fitted and then of each of `batches`; without
        them nothing is said of what grows with the rate.

    Returns
    -------
    For each of `batches` the lower and the upper limit, in the unit of the record; zero at padding.
    """
    at = carried[0].fit.theta
    # a run that no fit saw is predicted without the factor of its loading, which may be anything
    loaded = [_deviations(batch) if batch is not fitted else 0.0 for batch in batches]
    batches = [batch if batch is fitted else batch.without_factors() for batch in batches]
    shifts = modulus_shifts(model, at, fitted)
    moved = [shifts if b is fitted else modulus_shifts(model, at, b) for b in batches]
    tails = student.ppf(_TAILS[1], len(fitted.weight)) / ndtri(_TAILS[1]) if structured else 1.0
    parts: list[list[tuple[np.ndarray, np.ndarray, float]]] = [[] for _ in batches]
    for one, probability in zip(carried, probabilities, strict=True):
        others = [name for name in candidates if name not in one.effects]
        own = signatures(model, fitted, one.fit, others) if others else None
        lacking = discrepancy(model, fitted, one.fit, others, batches, own)
        root = root_of_covariance(fitted, one.fit)[0] if one.fit.free else None
        off = response(one.fit.jacobian, shifts) if one.fit.free and len(shifts) else None
        left = max(noise, rms(one.fit.run_errors)) * tails
        wider = widening(model, fitted, one.fit, own, left)
        faster = [np.ones(len(batch.weight)) for batch in batches]
        if structured and rates:
            faster = [growth(one.fit.run_errors, rates[0], other) for other in rates[1:]]
        for part, batch, square, more, by_moduli, own_factor in zip(
            parts, batches, lacking, faster, moved, loaded, strict=True
        ):
            size = left * more[:, None]
            found = _distribution(model, one.fit, (root, off, by_moduli), square, size, batch)
            if found is not None:
                spread = np.hypot(wider * found[1], own_factor * found[0])
                part.append((found[0], spread, probability))
    return [_limits(part, batch) for part, batch in zip(parts, batches, strict=True)]


def _deviations(batch: Batch) -> Float[np.ndarray, "runs 1"]:
    """Return by how much the factor of each run may differ from one; zero where it has none."""
    own = batch.records.loadings
    if own is None:
        return np.zeros((len(batch.weight), 1))
    return np.any(own.members, axis=0)[:, None] * batch.records.deviation_of_loadings


def _distribution(
    model: AugmentedModel, fit: Fit,
    uncertain: tuple[np.ndarray | None, np.ndarray | None, np.ndarray],
    square: np.ndarray, left: np.ndarray, batch: Batch,
) -> tuple[np.ndarray, np.ndarray] | None:  # fmt: skip
    """Return mean and standard deviation of what an explanation predicts; None if it runs away.

    Uncertain are the constants by noise (a root of their covariance), and by errors of the moduli
    (their response), which change the prediction themselves, too.
    """
    root, off, by_moduli = uncertain
    weight, recorded = np.asarray(batch.weight), np.asarray(batch.recorded)
    seen = weight > 0
    scale = np.where(seen, weight, 1.0)
    residual, jacobian, _ = model.linearise(fit.theta, batch, fit.free)
    if not np.all(np.isfinite(residual)):
        return None
    variance = square / scale**2
    if root is not None:
        slope = jacobian / scale
        columns = np.tensordot(root, np.where(np.isfinite(slope), slope, 0.0), axes=(0, 0))
        variance = variance + np.sum(columns**2, axis=0)
        if off is not None:
            by_moduli = by_moduli - np.tensordot(off, slope * scale, axes=(0, 0))
    variance = variance + np.sum(np.nan_to_num(by_moduli / scale) ** 2, axis=0)
    samples = np.maximum(np.count_nonzero(seen, axis=1), 1)
    # of a flow curve or sweep each sample has the noise that it is weighted by
    size = np.where(seen, 1.0 / (scale * np.sqrt(samples)[:, None]), 0.0)
    mean = np.where(seen, residual / scale + recorded, 0.0)
    return mean, np.sqrt(variance + (left * size) ** 2)


def _limits(part: list[tuple[np.ndarray, np.ndarray, float]], batch: Batch) -> np.ndarray:
    """Return the limits of mixed distributions; not a number where there is none."""
    seen = np.asarray(batch.weight) > 0
    if not part:
        return np.full((2, *seen.shape), np.nan)
    mean, deviation, share = map(np.array, zip(*part, strict=True))
    deviation = np.maximum(deviation, np.finfo(float).tiny)
    share = share[:, None, None] / np.sum(share)
    return np.where(seen, np.array([quantile(mean, deviation, share, p) for p in _TAILS]), 0.0)
