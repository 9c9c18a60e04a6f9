"""Noise of a record. Sizes are relative to the root-mean-square of the signal."""

import numpy as np


def rms(signal: np.ndarray) -> float:
    """Return the root-mean-square."""
    return float(np.sqrt(np.mean(np.square(signal))))


def white(signal: np.ndarray, size: float, generator: np.random.Generator) -> np.ndarray:
    """Return the signal with independent Gaussian noise."""
    return signal + size * rms(signal) * generator.standard_normal(len(signal))


def correlated(
    signal: np.ndarray, size: float, correlation: float, generator: np.random.Generator
) -> np.ndarray:
    """Return the signal with stationary AR(1) noise; neighbours are correlated by `correlation`."""
    drawn = generator.standard_normal(len(signal))
    noise = np.empty(len(signal))
    noise[0] = drawn[0]
    for i in range(1, len(signal)):
        noise[i] = correlation * noise[i - 1] + np.sqrt(1 - correlation**2) * drawn[i]
    return signal + size * rms(signal) * noise


def proportional(signal: np.ndarray, size: float, generator: np.random.Generator) -> np.ndarray:
    """Return the signal with noise in proportion to its value at each sample."""
    return signal * (1 + size * generator.standard_normal(len(signal)))


def outliers(
    signal: np.ndarray, share: float, size: float, generator: np.random.Generator
) -> np.ndarray:
    """Return the signal with a share of the samples thrown off by `size` times the rms, ± by lot.

    At least one sample is thrown off; how far varies by half to one and a half times the size.
    """
    count = max(1, round(share * len(signal)))
    where = generator.choice(len(signal), count, replace=False)
    thrown = np.array(signal, float)
    jumps = generator.choice([-1.0, 1.0], count) * generator.uniform(0.5, 1.5, count)
    thrown[where] += size * rms(signal) * jumps
    return thrown
