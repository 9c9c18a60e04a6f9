"""Draws of a law's parameters, held against the data that were fitted.

The covariance of a fit speaks of the law's linearisation. Where two terms nearly exchange each
other it reaches far beyond the laws that fit, or stops short of them: there the draws are weighed
by their likelihood, or there are none.

The proposal is the Gaussian of the covariance; where that fails, a mixture with wider
ones, so that no law that fits has next to no chance   [defensive importance sampling: Hesterberg
1995, Technometrics 37, 185].
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from jaxtyping import Float, Int
from scipy.special import logsumexp

Deviance = Callable[[Float[np.ndarray, "laws p"]], Float[np.ndarray, " laws"]]
"""−2 log-likelihood of many laws over that of the fit; infinite for a law that runs away."""

N_DRAWS = 96
"""Draws that test the linearisation."""

_WIDTHS = (2.0, 4.0, 2.0)
"""Widths of as many further batches of draws, where it fails."""

LINEAR_SHARE = 0.9
"""Effective share of unweighted draws from which the linearisation counts as valid.

It is 1 / (1 + variance of the weights): here they differ by a third. A log-normal likelihood with a
relative width of a quarter is just bent enough to be weighed.
"""

FEWEST_EFFECTIVE = 40.0
"""Of fewer independent draws, a 95 % limit is less than one draw from the end."""

_INSEPARABLE = 1e-12
"""Relative eigenvalue of normal equations at which two terms are one: the square of 1e-6, below
which sensitivities integrated to 1e-5 do not differ."""

Method = Literal["linear", "weighed", "none"]


@dataclass(frozen=True)
class WeighedDraws:
    """What the data leave of a law's parameters.

    Attributes
    ----------
    method
        ``"linear"``: the covariance serves. ``"weighed"``: `values` do, and the covariance does
        not. ``"none"``: no draws, so no interval and no band.
    values
        Equally likely parameters, shape (draws, p); empty unless weighed.
    intervals
        95 % interval of each parameter, of all that was weighed, shape (p, 2); nan unless weighed.
    linear_share
        Effective share of draws from the covariance under the likelihood, 0 to 1.
    effective
        Number of independent draws that the weighed ones are worth.
    reason
        One sentence where the covariance does not serve, else empty.
    """

    method: Method
    values: Float[np.ndarray, "draws p"]
    intervals: Float[np.ndarray, "p 2"]
    linear_share: float
    effective: float
    reason: str = ""

    def to_json(self) -> dict[str, Any]:
        """Return everything as JSON-able values."""
        return {
            "method": self.method,
            "values": self.values.tolist(),
            "linear_share": self.linear_share,
            "effective": self.effective,
            "reason": self.reason,
        }


def weighed_draws(
    centre: Float[np.ndarray, " p"],
    covariance: Float[np.ndarray, "p p"],
    deviance: Deviance,
    seed: int = 0,
) -> WeighedDraws:
    """Return draws of parameters that fit the data, or say why there are none."""
    size = centre.size
    scale = np.sqrt(np.clip(np.diag(covariance), 0.0, None))
    if not np.all(np.isfinite(covariance)) or np.any(scale <= 0.0):
        return _nothing(size, 0.0, "no sensitivity of the data to one of the constants")
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    spread = scale[:, None] * vectors * np.sqrt(np.clip(values, 0.0, None))
    rng = np.random.default_rng(seed)
    unit = _in_pairs(rng, size)
    found = np.asarray(deviance(centre + unit @ spread.T))
    share = _effective(-0.5 * (found - np.sum(unit**2, axis=1))) / N_DRAWS
    if share >= LINEAR_SHARE:
        return WeighedDraws("linear", *_no_values(size), share, share * N_DRAWS)
    more = [width * _in_pairs(rng, size) for width in _WIDTHS]
    found = np.concatenate([found, *(np.asarray(deviance(centre + m @ spread.T)) for m in more)])
    unit = np.concatenate([unit, *more])
    weights = -0.5 * found - _log_mixture(unit, np.array([1.0, *_WIDTHS]))
    effective = _effective(weights)
    if effective < FEWEST_EFFECTIVE:
        why = f"of {len(unit)} laws drawn only {effective:.0f} fit the data"
        return _nothing(size, share, why, effective)
    values = centre + unit @ spread.T
    limits = np.stack([_limits(column, weights) for column in values.T])
    kept = values[_resampled(weights, rng)]
    return WeighedDraws("weighed", kept, limits, share, effective, _reason(share))


def exchangeable(inverse: Float[np.ndarray, "p p"], columns: Float[np.ndarray, "rows p"]) -> bool:
    """Return whether some combination of the parameters leaves no trace in the data.

    Parameters
    ----------
    inverse
        (SᵀS)⁻¹ as the fit used it; a pseudo-inverse is silent on such a combination.
    columns
        The sensitivities S.
    """
    norms = np.linalg.norm(columns, axis=0)
    if np.any(norms <= 0.0) or not np.all(np.isfinite(inverse)):
        return True
    scaled = columns / norms
    values = np.linalg.eigvalsh(scaled.T @ scaled)
    return bool(values[0] < _INSEPARABLE * values[-1])


def _reason(share: float) -> str:
    return (
        "the constants exchange each other: only "
        f"{100 * share:.0f} % of the laws inside their linearised intervals fit the data, so the "
        "intervals are those of the laws that do"
    )


def _nothing(size: int, share: float, why: str, effective: float = 0.0) -> WeighedDraws:
    reason = f"the constants exchange each other ({why}), so they have no interval and no band"
    return WeighedDraws("none", *_no_values(size), share, effective, reason)


def _no_values(size: int) -> tuple[np.ndarray, np.ndarray]:
    return np.zeros((0, size)), np.full((size, 2), np.nan)


def _limits(
    values: Float[np.ndarray, " draws"], log_weights: Float[np.ndarray, " draws"]
) -> Float[np.ndarray, "2"]:
    """Return the 2.5 and 97.5 % quantiles of weighed values."""
    order = np.argsort(values)
    weights = np.exp(log_weights - np.max(log_weights))[order]
    middle = (np.cumsum(weights) - 0.5 * weights) / np.sum(weights)
    return np.interp((0.025, 0.975), middle, values[order])


def _effective(log_weights: Float[np.ndarray, " draws"]) -> float:
    """Return (Σw)² / Σw²   [Kish 1965]."""
    highest = np.max(log_weights)
    if not np.isfinite(highest):
        return 0.0
    weights = np.exp(log_weights - highest)
    return float(np.sum(weights) ** 2 / np.sum(weights**2))


def _in_pairs(rng: np.random.Generator, size: int) -> Float[np.ndarray, "draws p"]:
    """Return unit normals and their opposites: their mean is the fit."""
    half = rng.normal(size=(N_DRAWS // 2, size))
    return np.concatenate([half, -half])


def _log_mixture(
    unit: Float[np.ndarray, "draws p"], widths: Float[np.ndarray, " k"]
) -> Float[np.ndarray, " draws"]:
    """Return the logarithm of the density that made all draws, up to a constant."""
    squares = np.sum(unit**2, axis=1)[:, None]
    return np.asarray(
        logsumexp(-0.5 * squares / widths**2 - unit.shape[1] * np.log(widths), axis=1)
    )


def _resampled(
    log_weights: Float[np.ndarray, " draws"], rng: np.random.Generator
) -> Int[np.ndarray, " n"]:
    """Return positions of equally likely draws, by systematic resampling."""
    weights = np.exp(log_weights - np.max(log_weights))
    edges = np.cumsum(weights / np.sum(weights))
    places = (rng.uniform() + np.arange(N_DRAWS)) / N_DRAWS
    return np.minimum(np.searchsorted(edges, places), len(weights) - 1)
