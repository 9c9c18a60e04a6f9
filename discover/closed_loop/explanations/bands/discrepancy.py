"""What an explanation may still lack, and what that changes in other flows."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float
from scipy.optimize import fminbound

from discover.forward import AugmentedModel, Batch
from discover.inference.least_squares import Fit
from discover.statistics import independent_samples

_DECADES = 6.0
"""By which the prior may be narrower or wider than what the best seen combination says."""


def discrepancy(
    model: AugmentedModel,
    fitted: Batch,
    fit: Fit,
    effects: Sequence[str],
    batches: Sequence[Batch],
    own: Float[np.ndarray, "effects fitted m"] | None,
) -> list[Float[np.ndarray, "_ _"]]:
    """Return the mean square of what small amounts of every other candidate would change.

    A law that holds all candidates beside the explanation, each in an amount with a Gaussian prior
    whose width the data choose   [MacKay 1992, Neural Comput. 4, 415], to first order about the
    fit. Where the fitted records leave noise the width vanishes; where they leave structure, what
    would explain it goes on into faster flows as the candidates do.

    Parameters
    ----------
    model, fitted, fit
        The model, the runs that were fitted, and the fit of the explanation.
    effects
        Candidates that are not in it.
    batches
        Runs to predict; what was fitted may be one of them.
    own
        What the candidates do in the fitted runs (`signatures`), where that is known already.

    Returns
    -------
    For each of `batches`, in its squared weighted residuals; zero at padding.
    """
    if not effects:
        return [np.zeros_like(np.asarray(batch.weight)) for batch in batches]
    own = signatures(model, fitted, fit, effects) if own is None else own
    seen = np.asarray(fitted.weight) > 0
    out = []
    for batch in batches:
        other = own if batch is fitted else signatures(model, batch, fit, effects)
        out.append(changed(fit, own, other, seen))
    return out


def changed(
    fit: Fit,
    own: Float[np.ndarray, "effects runs n"],
    other: Float[np.ndarray, "effects others m"],
    seen: Bool[np.ndarray, "runs n"],
) -> Float[np.ndarray, "others m"]:
    """Return the mean square change, from what each candidate does in the fitted and other runs.

    Parameters
    ----------
    fit
        Of the explanation.
    own, other
        What the candidates do (`signatures`) in the runs that were fitted, and in others.
    seen
        Samples by which the amounts of the candidates are told.
    """
    told = own[:, seen]
    size = np.linalg.norm(told, axis=1)
    # what does nothing here, or cannot be followed, says nothing there
    finite = np.all(np.isfinite(other), axis=(1, 2))
    usable = (size > 0.0) & np.isfinite(size) & finite
    if not np.any(usable):
        return np.zeros(other.shape[1:])
    residual = fit.residual[seen]
    design, change = (told[usable] / size[usable, None]).T, other[usable] / size[usable, None, None]
    if fit.free:
        basis = np.linalg.qr(fit.jacobian[:, seen].T)[0]
        design = design - basis @ (basis.T @ design)
    # neighbours say the same: all rows together count as many as there are independent samples
    effective = sum(
        independent_samples(row[s]) for row, s in zip(fit.residual, seen, strict=True) if np.any(s)
    )
    mean, root = posterior(design, -residual, min(effective, float(len(residual))))
    shift = np.tensordot(mean, change, axes=1)
    return shift**2 + np.sum(np.tensordot(root, change, axes=1) ** 2, axis=0)


def posterior(
    design: Float[np.ndarray, "n terms"], target: Float[np.ndarray, " n"], samples: float
) -> tuple[Float[np.ndarray, " terms"], Float[np.ndarray, "rank terms"]]:
    """Return mean and a root of the covariance of coefficients whose prior width the data choose.

    The noise is as large as is likeliest at each width.
    """
    left, singular, right = np.linalg.svd(design, full_matrices=False)
    told = singular > 1e-10 * singular[0]
    left, singular, right = left[:, told], singular[told], right[told]
    seen = left.T @ target
    share = samples / len(target)
    power = share * singular**2
    total = share * float(target @ target)

    def noise(narrowness: float) -> float:
        return (
            max(total - share * float(seen**2 @ (power / (power + narrowness))), 1e-300) / samples
        )

    def unlikely(logarithm: float) -> float:
        narrowness = np.exp(logarithm)
        widths = float(np.sum(np.log1p(power / narrowness)))
        return samples * np.log(noise(narrowness)) + widths

    ends = np.log(power[0]) + np.array([-_DECADES, _DECADES]) * np.log(10.0)
    narrowness = float(np.exp(fminbound(unlikely, *ends)))
    mean = (np.sqrt(share * power) * seen / (power + narrowness)) @ right
    root = np.sqrt(noise(narrowness) / (power + narrowness))[:, None] * right
    return mean, root


def signatures(
    model: AugmentedModel, batch: Batch, fit: Fit, effects: Sequence[str]
) -> Float[np.ndarray, "effects runs n"]:
    """Return what a small amount of each effect changes in the weighted residuals, over it."""
    at = tuple(model.positions(name)[0] for name in effects)
    return model.linearise(fit.theta, batch, at).jacobian
