"""What a correlated sequence is worth."""

import numpy as np
from jaxtyping import Float


def independent_samples(values: Float[np.ndarray, " n"]) -> float:
    """Return the number of independent samples that a correlated sequence is worth.

    n/(1 + 2 Σ ρ_k), summed up to the first lag at which nothing is correlated any more   [Geyer
    1992, Stat. Sci. 7, 473, for sums that end where the correlation is lost]. Of a smooth sequence
    this counts its swings and not its samples, so it does not depend on how densely it was
    sampled; with the correlation of neighbours alone, the count would fall the more one measures.
    """
    n = len(values)
    power = float(np.sum(values**2))
    if power == 0.0 or n < 3:
        return max(1.0, float(n))
    spectrum = np.abs(np.fft.rfft(values, 2 * n)) ** 2
    correlation = np.fft.irfft(spectrum)[:n] / power
    lost = np.flatnonzero(correlation <= 0.0)
    together = float(np.sum(correlation[1 : lost[0] if len(lost) else n]))
    return max(1.0, n / (1.0 + 2.0 * together))
