"""Rates derived from strain."""

import numpy as np
from jaxtyping import Float

from discover.errors import InputError

DEFAULT_WINDOW = 15
"""Samples in the moving window; over them the strain is taken to be a cubic in time."""

_DEGREE = 3

_CHUNK = 50_000


def differentiate(
    times: Float[np.ndarray, " n"], values: Float[np.ndarray, " n"], window: int = DEFAULT_WINDOW
) -> Float[np.ndarray, " n"]:
    """Return the time derivative of a noisy record, from a moving cubic fit.

    A cubic is fitted by least squares to the `window` samples nearest in order to each sample, and
    its slope taken there   [Savitzky & Golay 1964, Anal. Chem. 36, 1627, for any spacing].

    `times`: sampling times in s, increasing. `window`: number of samples in the window, 5 or more;
    fewer if the record is shorter. Raises InputError if the window is too short, or the record has
    fewer than 5 samples.
    """
    if window < _DEGREE + 2:
        raise InputError(f"The smoothing window must hold at least 5 samples; got {window}.")
    n = len(times)
    if n < _DEGREE + 2:
        raise InputError(
            f"A rate cannot be derived from {n} samples of strain; give at least 5, or a "
            "column shear_rate_1_s."
        )
    window = min(window, n)
    if n > _CHUNK:
        # a window of its own for each sample: in parts, so that a million samples fit in memory
        parts = [
            _slopes(times, values, window, np.arange(i, min(i + _CHUNK, n)))
            for i in range(0, n, _CHUNK)
        ]
        return np.concatenate(parts)
    return _slopes(times, values, window, np.arange(n))


def _slopes(
    times: np.ndarray, values: np.ndarray, window: int, samples: np.ndarray
) -> Float[np.ndarray, " m"]:
    first = np.clip(samples - window // 2, 0, len(times) - window)
    index = first[:, None] + np.arange(window)
    offset = times[index] - times[samples, None]
    # scaled to the window's width: the normal equations stay well conditioned
    width = np.max(np.abs(offset), axis=1, keepdims=True)
    powers = (offset / width)[:, :, None] ** np.arange(_DEGREE + 1)
    basis, triangle = np.linalg.qr(powers)
    projected = np.einsum("nwk,nw->nk", basis, values[index])
    coefficients = np.linalg.solve(triangle, projected[:, :, None])[:, :, 0]
    return coefficients[:, 1] / width[:, 0]
