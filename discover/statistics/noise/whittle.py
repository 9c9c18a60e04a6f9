"""The likelihood of a row under a spectrum, by Whittle's approximation in the cosine transform."""

import numpy as np
from jaxtyping import Float
from scipy.fft import dct


def cosine_power(row: Float[np.ndarray, " n"]) -> Float[np.ndarray, " _"]:
    """Return the power of a row at 1, 2, … n − 1 half swings, without its mean."""
    return np.square(np.asarray(dct(row, type=2, norm="ortho")))[1:]


def whittle_likelihood(
    power: Float[np.ndarray, " m"], spectra: Float[np.ndarray, "*tried m"]
) -> Float[np.ndarray, "*tried"]:
    """Return the logarithm of the likelihood under each spectrum, its level fitted.

    The transform all but diagonalises the covariance of what is stationary   [Whittle 1953, Ark.
    Mat. 2, 423; Ahmed, Natarajan & Rao 1974, IEEE Trans. Comput. 23, 90].
    """
    level = np.maximum(np.mean(power / spectra, axis=-1), 1e-300)
    return -0.5 * len(power) * np.log(level) - 0.5 * np.sum(np.log(spectra), axis=-1)
