"""How uncertain the parameters of a least-squares fit are when the noise is correlated.

A least-squares fit weighs all samples alike whatever their noise, so its covariance is

    C = (SᵀS)⁻¹ Sᵀ Ω S (SᵀS)⁻¹,

with S the weighted sensitivities and Ω the covariance of the noise, and of errors of what counts as
known. That of the noise is estimated from the residual as an autoregressive process
(`noise_model`): a block bootstrap needs a refit for every draw, an effective sample size alone
would shrink all directions alike, while slow noise spoils a slow signature more than a fast one.

A combination of parameters that changes no sample is not determined, however small the noise.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from discover.statistics.noise.noise_model import NoiseModel, noise_model

HALF_BAND = 1.96
"""Standard deviations of half of a 95 % band."""

_UNSEEN = 1e-14
"""Of the largest eigenvalue of SᵀS, its columns made of length one: below it is only rounding."""

_OPEN = 100.0
"""Standard deviation of what no sample sees, in units in which every column has length one: so far
off, either of two parameters that cancel changes the residual a hundredfold of its unit."""


def root_of(covariance: Float[np.ndarray, "p p"]) -> Float[np.ndarray, "p p"]:
    """Return R with RRᵀ a covariance: its columns are independent, each a standard deviation."""
    values, vectors = np.linalg.eigh(covariance)
    return vectors * np.sqrt(np.clip(values, 0.0, None))


def least_squares_covariance(
    columns: Float[np.ndarray, "rows p"],
    residual: Float[np.ndarray, " rows"],
    sequences: Sequence[Int[np.ndarray, " _"]],
    shared: Float[np.ndarray, "rows k"] | None = None,
    sizes: Sequence[float] | None = None,
) -> tuple[Float[np.ndarray, "p p"], Float[np.ndarray, "p p"], NoiseModel]:
    """Return C = (SᵀS)⁻¹ SᵀΩS (SᵀS)⁻¹, (SᵀS)⁻¹, and the noise of which Ω is made.

    Where a sensitivity is not finite, both are infinite. What no sample sees has no inverse: there
    (SᵀS)⁻¹ is the pseudo-inverse, and the deviation in C is far larger than any finding.

    `columns`: sensitivities S. `sequences`: rows of each sequence of observations, in the order of
    time. `shared`: Z of errors Z u that all rows share, u of unit variance, beside the noise; None
    for none. `sizes`: of the noise of each sequence, if it is taken to be the same in all, as
    `noise_model` takes them.
    """
    if not (np.all(np.isfinite(columns)) and np.all(np.isfinite(residual))):
        # of a law that runs away beside its fit: nothing is known of its constants
        told = [np.nan_to_num(residual[rows], posinf=0.0, neginf=0.0) for rows in sequences]
        nothing = np.full((columns.shape[1],) * 2, np.inf)
        return nothing, nothing, noise_model(told, columns.shape[1], sizes)
    noise = noise_model([residual[rows] for rows in sequences], columns.shape[1], sizes)
    # columns of like size, or the pseudo-inverse would drop what is merely small
    norms = np.linalg.norm(columns, axis=0)
    norms = np.where(norms > 0, norms, 1.0)
    scaled = columns / norms
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    seen = values > _UNSEEN * np.max(values, initial=0.0)
    inverse = vectors[:, seen] / values[seen] @ vectors[:, seen].T
    unseen = _OPEN**2 * vectors[:, ~seen] @ vectors[:, ~seen].T
    middle = sum(
        scaled[rows].T @ noise.covariance_times(i, scaled[rows]) for i, rows in enumerate(sequences)
    )
    if shared is not None:
        common = scaled.T @ shared
        middle = middle + common @ common.T
    squares = np.outer(norms, norms)
    return (inverse @ middle @ inverse + unseen) / squares, inverse / squares, noise
