"""Noises of hostile records: functions of a stress and a lot; 1 % where no size is given."""

from collections.abc import Callable

import numpy as np
from hostile_records import FLOWS
from independent import noise as noises
from independent.noise import correlated, rms
from scipy.interpolate import UnivariateSpline
from scipy.ndimage import median_filter


def white(s, lot, size):
    return s + size * rms(s) * lot.standard_normal(len(s))


def _steps(s, lot, share, before=0.001):
    """Return readings in steps of a share of the largest stress, with some noise before them."""
    step = share * np.max(np.abs(s))
    return step * np.round(white(s, lot, before) / step)


def _strays(s, lot, share):
    noisy = white(s, lot, 0.01)
    where = lot.choice(len(s), max(1, round(share * len(s))), replace=False)
    noisy[where] += rms(s) * lot.uniform(0.3, 1.0, len(where)) * lot.choice([-1, 1])
    return noisy


def _wandering(s, lot, size):
    """Return a random walk that ends some `size` of the rms away: a drifting zero, 1/f²."""
    walk = np.cumsum(lot.standard_normal(len(s))) / np.sqrt(len(s))
    return s + size * rms(s) * walk + 0.003 * rms(s) * lot.standard_normal(len(s))


def _by_hand(s, lot, size, correlation=0.7):
    """Return the error of a hand along a curve, in shares of each value."""
    error, last = np.zeros(len(s)), lot.standard_normal()
    for i, new in enumerate(lot.standard_normal(len(s))):
        last = correlation * last + np.sqrt(1 - correlation**2) * new
        error[i] = last
    return s * (1 + size * error)


def _loaded(s, lot, spread):
    """Return white noise, and a factor of each run, which is a loading of its own."""
    factor = 1 + spread * lot.standard_normal()
    return factor * s + 0.01 * rms(s) * lot.standard_normal(len(s))


def _interpolated(s, lot, every):
    """Return an export on a fine grid of what was recorded less often: straight lines between."""
    at, noisy = np.arange(len(s)), white(s, lot, 0.01)
    told = np.unique(np.append(at[::every], at[-1]))
    return np.interp(at, told, noisy[told])


def _held_and_rounded(s, lot):
    """Return every second value as the one before it, all with three digits."""
    noisy = white(s, lot, 0.01)
    noisy[1::2] = noisy[: len(noisy) - 1 : 2][: len(noisy[1::2])]
    return np.array([float(f"{value:.3g}") for value in noisy])


def _moving_mean(s, lot, width):
    noisy, ones = white(s, lot, 0.01), np.convolve(np.ones(len(s)), np.ones(width), "same")
    return np.convolve(noisy, np.ones(width), "same") / ones


def _splined(s, lot, size=0.01):
    """Return noise that was smoothed by a cubic spline, as far as its size is to be expected."""
    at, sigma = np.arange(len(s)), size * rms(s)
    noisy = s + sigma * lot.standard_normal(len(s))
    return UnivariateSpline(at, noisy, s=len(s) * sigma**2)(at)


def _stamped(s, lot, interval):
    """Return noise of samples taken up to half an interval, in samples, before or after."""
    at = np.arange(len(s))
    taken = np.interp(at + interval * lot.uniform(-0.5, 0.5, len(at)), at, s)
    return taken + 0.01 * rms(s) * lot.standard_normal(len(s))


def _between(s, lot, points, interval=0.1):
    """Return noise of even samples, as straight lines carry it to times evenly in log t."""
    end = FLOWS["slow.csv"][1][-1]
    known = np.arange(0, round(end / interval) + 1) * interval
    own = np.append(0.0, lot.standard_normal(len(known) - 1))
    return s + 0.01 * rms(s) * np.interp(np.geomspace(0.02, end, points), known, own)


def _telegraph(n, lot):
    """Return noise of a loose contact: two levels of some twelve samples each."""
    turns = lot.random(n) < 1.0 / 12.0
    return 1.5 * (-1.0) ** np.cumsum(turns) + 0.3 * lot.standard_normal(n)


def _pink(n, lot):
    waves = np.fft.rfft(lot.standard_normal(n))
    waves[1:] /= np.sqrt(np.arange(1, len(waves)))
    waves[0] = 0.0
    noise = np.fft.irfft(waves, n)
    return noise / rms(noise)


def _bursts(n, lot):
    """Return noise with two stretches of eight samples that are ten times as loud."""
    size = np.full(n, 0.7)
    for begin in lot.choice(np.arange(5, n - 12), 2, replace=False):
        size[begin : begin + 8] = 7.0
    return size * lot.standard_normal(n)


def _wandering_gain(s, lot):
    walk = np.cumsum(lot.standard_normal(len(s))) / np.sqrt(0.5 * len(s))
    return white(s * (1.0 + 0.01 * walk), lot, 0.005)


def _knocked_ends(s, lot):
    noisy = white(s, lot, 0.01)
    noisy[[1, -1]] += 0.01 * rms(s) * lot.uniform(20.0, 40.0, 2) * lot.choice([-1, 1], 2)
    return noisy


def _uneven_clock(s, lot):
    at = np.arange(len(s)) + lot.uniform(-0.5, 0.5, len(s))
    return white(np.interp(at, np.arange(len(s)), s), lot, 0.005)


SHAPES: dict[str, Callable] = {
    "one_sided": lambda n, lot: lot.exponential(1.0, n) - 1.0,
    "growing": lambda n, lot: np.linspace(0.2, 3.0, n) * lot.standard_normal(n),
    # white noise three times as large, of which each sample is the mean of nine
    "smoothed": lambda n, lot: (
        3.0 * np.convolve(lot.standard_normal(n + 8), np.full(9, 1.0 / 9.0), "valid")
    ),
    "telegraph": _telegraph, "pink": _pink, "bursts": _bursts,
}  # fmt: skip
NOISES: dict[str, Callable] = {
    "shaped": lambda s, lot, shape: s + 0.01 * rms(s) * shape(len(s), lot),
    "level": lambda s, lot, size: s + size * lot.standard_normal(len(s)),  # in Pa
    "autoregressive": lambda s, lot, size, rho: correlated(s, size, rho, lot),
    "autoregressive_pascal": lambda s, lot, size, rho: (
        s + size * correlated(np.ones(len(s)), 1.0, rho, lot) - size
    ),
    "proportional": lambda s, lot, share: s * (1 + share * lot.standard_normal(len(s))),
    # Student's: with two degrees of freedom it has no variance
    "heavy": lambda s, lot, size, freedom=2: (
        s + size * rms(s) * lot.standard_t(freedom, len(s))
    ),
    "thrown": lambda s, lot, share: noises.outliers(white(s, lot, 0.01), share, 1.0, lot),
    "walk_alone": lambda s, lot, size: s + size * np.cumsum(lot.standard_normal(len(s))),
    "growing_with_stress": lambda s, lot, share, at: (
        s * (1 + share * (s / at) ** 2 * lot.standard_normal(len(s)))
    ),
    "share_and_floor": lambda s, lot, share, floor: (
        s + np.hypot(share * s, floor) * lot.standard_normal(len(s))
    ),
    "median_of": lambda s, lot, width: median_filter(white(s, lot, 0.01), width, mode="nearest"),
    "dropouts": lambda s, lot: np.where(lot.random(len(s)) < 0.05, 0.0, white(s, lot, 0.01)),
    "slow_update": lambda s, lot: white(s, lot, 0.01)[3 * (np.arange(len(s)) // 3)],
    "steps_of": _steps, "with_strays": _strays, "wandering": _wandering, "loaded": _loaded,
    "read_by_hand": _by_hand, "wandering_gain": _wandering_gain, "knocked_ends": _knocked_ends,
    "uneven_clock": _uneven_clock, "white": white, "interpolated": _interpolated,
    "held_and_rounded": _held_and_rounded, "moving_mean": _moving_mean, "splined": _splined,
    "stamped": _stamped, "between": _between,
}  # fmt: skip
OF_NAMES = SHAPES, NOISES
