"""How much wider a band has to be, judged by runs that are left out of the fit in turn."""

import numpy as np
from jaxtyping import Float
from scipy.special import ndtri

from discover.closed_loop.explanations.bands.discrepancy import changed
from discover.closed_loop.search.scoring.left_out import left_out_parts
from discover.forward import AugmentedModel, Batch
from discover.inference.fit_uncertainty import covariance_and_noise
from discover.inference.least_squares import Fit
from discover.inference.problem import FitProblem

_HELD = 0.95  # share of the samples that a band should hold


def widening(
    model: AugmentedModel,
    fitted: Batch,
    fit: Fit,
    signatures: Float[np.ndarray, "effects runs n"] | None,
    left: float,
) -> float:
    """Return the factor on a band with which it holds every run that is left out, at least 1.

    Each run (of few, each part of one) is predicted from the others, with a band made as for runs
    that no fit saw. The factor is the largest that one of them needs: another run needs more in one
    case of R + 1, were the R + 1 runs alike   [Vovk, Gammerman & Shafer 2005, Algorithmic Learning
    in a Random World; Barber et al. 2021, Ann. Stat. 49, 486, the jackknife+].

    Parameters
    ----------
    model, fitted, fit
        The model, the fitted runs, and the fit of an explanation to them.
    signatures
        What the candidates that it may lack do in them; None without any.
    left
        Relative size of what the explanation leaves of a run, as in the band.
    """
    weighted = np.asarray(fitted.weight) > 0
    # of a relative error each sample has an equal share
    noise = left / np.sqrt(np.maximum(np.count_nonzero(weighted, axis=1), 1))[:, None]
    needed = [1.0]
    for out, missed in left_out_parts(FitProblem(model, fitted), fit):
        kept = weighted & ~out
        variance = np.broadcast_to(noise**2, weighted.shape).copy()
        if fit.free:
            variance += _of_constants(fitted, fit, kept)
        if signatures is not None:
            variance += changed(fit, signatures, signatures, kept)
        ratio = np.sqrt(missed[out] / variance[out])
        if np.all(np.isfinite(ratio)):
            needed.append(float(np.quantile(ratio, _HELD)) / float(ndtri(0.5 + 0.5 * _HELD)))
    return max(needed)


def _of_constants(fitted: Batch, fit: Fit, kept: np.ndarray) -> Float[np.ndarray, "runs n"]:
    """Return the variance of a prediction from constants that some samples tell."""
    covariance, _ = covariance_and_noise(fitted, fit.residual * kept, fit.jacobian * kept)
    slopes = fit.jacobian.reshape(len(fit.free), -1)
    variance = np.einsum("ik,ij,jk->k", slopes, covariance, slopes, optimize=True)
    return np.maximum(np.nan_to_num(variance), 0.0).reshape(kept.shape)
