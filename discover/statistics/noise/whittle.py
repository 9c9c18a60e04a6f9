"""The likelihood of a row under a spectrum, by Whittle's approximation in the cosine transform."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy.fft import dct

HALF_SWINGS = np.array([1.0, 2.0, 4.0, 8.0])
"""Of a smooth misfit along a run, as they are tried."""


class Spectra(NamedTuple):
    """Spectra as their likelihood takes them: one over each, and half of its logarithms, summed."""

    inverse: Float[np.ndarray, "*tried m"]
    normalised: Float[np.ndarray, "*tried"]


def spectra(values: Float[np.ndarray, "*tried m"]) -> Spectra:
    """Return spectra of any level."""
    return Spectra(1.0 / values, 0.5 * np.sum(np.log(values), axis=-1))


def cosine_power(row: Float[np.ndarray, " n"]) -> Float[np.ndarray, " _"]:
    """Return the power of a row at 1, 2, … n − 1 half swings, without its mean."""
    return np.square(np.asarray(dct(row, type=2, norm="ortho")))[1:]


def whittle_likelihood(
    power: Float[np.ndarray, " m"], tried: Spectra
) -> Float[np.ndarray, "*tried"]:
    """Return the logarithm of the likelihood under each spectrum, its level fitted.

    The transform all but diagonalises the covariance of what is stationary   [Whittle 1953, Ark.
    Mat. 2, 423; Ahmed, Natarajan & Rao 1974, IEEE Trans. Comput. 23, 90].
    """
    level = np.maximum(tried.inverse @ power / len(power), 1e-300)
    return -0.5 * len(power) * np.log(level) - tried.normalised


def smooth(k: Int[np.ndarray, " m"]) -> Float[np.ndarray, "swings m"]:
    """Return the spectra of smooth misfits at so many half swings."""
    return 1.0 / (1.0 + (k / HALF_SWINGS[:, None]) ** 4)


def correlated(
    rho: Float[np.ndarray, " q"], angle: Float[np.ndarray, " m"]
) -> Float[np.ndarray, "q m"]:
    """Return the spectra of noise with first-order correlations, angles of π being the fastest."""
    rho = rho[:, None]
    return (1.0 - rho**2) / (1.0 - 2.0 * rho * np.cos(angle) + rho**2)
