"""Noises of hostile records that take more than a line: functions of a signal and a lot."""

import numpy as np
from independent.noise import rms
from scipy.interpolate import UnivariateSpline

INTERVAL, END = 0.1, 8.0
"""Of even samples and of a start-up, in s."""


def white(s, lot, size=0.01):
    return s + size * rms(s) * lot.standard_normal(len(s))


def steps_of(s, lot, share, before=0.001):
    """Return readings in steps of a share of the largest stress, with some noise before them."""
    step = share * np.max(np.abs(s))
    return step * np.round(white(s, lot, before) / step)


def with_strays(s, lot, share):
    read = white(s, lot)
    where = lot.choice(len(s), max(1, round(share * len(s))), replace=False)
    read[where] += rms(s) * lot.uniform(0.3, 1.0, len(where)) * lot.choice([-1, 1])
    return read


def wandering(s, lot, size):
    """Return a random walk that ends some `size` of the rms away: a drifting zero, 1/f²."""
    walk = np.cumsum(lot.standard_normal(len(s))) / np.sqrt(len(s))
    return s + size * rms(s) * walk + 0.003 * rms(s) * lot.standard_normal(len(s))


def read_by_hand(s, lot, size, correlation=0.7):
    """Return the error of a hand along a curve, in shares of each value."""
    error, last = np.zeros(len(s)), lot.standard_normal()
    for i, new in enumerate(lot.standard_normal(len(s))):
        last = correlation * last + np.sqrt(1 - correlation**2) * new
        error[i] = last
    return s * (1 + size * error)


def loaded(s, lot, spread):
    """Return white noise, and a factor of each run, which is a loading of its own."""
    factor = 1 + spread * lot.standard_normal()
    return factor * s + 0.01 * rms(s) * lot.standard_normal(len(s))


def interpolated(s, lot, every):
    """Return an export on a fine grid of what was recorded less often: straight lines between."""
    at, read = np.arange(len(s)), white(s, lot)
    told = np.unique(np.append(at[::every], at[-1]))
    return np.interp(at, told, read[told])


def held_and_rounded(s, lot):
    """Return every second value as the one before it, all with three digits."""
    read = white(s, lot)
    read[1::2] = read[: len(read) - 1 : 2][: len(read[1::2])]
    return np.array([float(f"{value:.3g}") for value in read])


def moving_mean(s, lot, width):
    read, ones = white(s, lot), np.convolve(np.ones(len(s)), np.ones(width), "same")
    return np.convolve(read, np.ones(width), "same") / ones


def splined(s, lot, size=0.01):
    """Return noise that was smoothed by a cubic spline, as far as its size is to be expected."""
    at, sigma = np.arange(len(s)), size * rms(s)
    read = s + sigma * lot.standard_normal(len(s))
    return UnivariateSpline(at, read, s=len(s) * sigma**2)(at)


def stamped(s, lot, interval):
    """Return noise of samples taken up to half an interval, in samples, before or after."""
    at = np.arange(len(s))
    taken = np.interp(at + interval * lot.uniform(-0.5, 0.5, len(at)), at, s)
    return taken + 0.01 * rms(s) * lot.standard_normal(len(s))


def uneven_clock(s, lot):
    at = np.arange(len(s)) + lot.uniform(-0.5, 0.5, len(s))
    return white(np.interp(at, np.arange(len(s)), s), lot, 0.005)


def between(s, lot, points):
    """Return noise of even samples, as straight lines carry it to times evenly in log t."""
    known = np.arange(0, round(END / INTERVAL) + 1) * INTERVAL
    own = np.append(0.0, lot.standard_normal(len(known) - 1))
    return s + 0.01 * rms(s) * np.interp(np.geomspace(0.02, END, points), known, own)


def wandering_gain(s, lot):
    walk = np.cumsum(lot.standard_normal(len(s))) / np.sqrt(0.5 * len(s))
    return white(s * (1.0 + 0.01 * walk), lot, 0.005)


def knocked_ends(s, lot):
    read = white(s, lot)
    read[[1, -1]] += 0.01 * rms(s) * lot.uniform(20.0, 40.0, 2) * lot.choice([-1, 1], 2)
    return read


# shapes


def telegraph(n, lot):
    """Return noise of a loose contact: two levels of some twelve samples each."""
    turns = lot.random(n) < 1.0 / 12.0
    return 1.5 * (-1.0) ** np.cumsum(turns) + 0.3 * lot.standard_normal(n)


def pink(n, lot):
    waves = np.fft.rfft(lot.standard_normal(n))
    waves[1:] /= np.sqrt(np.arange(1, len(waves)))
    waves[0] = 0.0
    noise = np.fft.irfft(waves, n)
    return noise / rms(noise)


def bursts(n, lot):
    """Return noise with two stretches of eight samples that are ten times as loud."""
    size = np.full(n, 0.7)
    for begin in lot.choice(np.arange(5, n - 12), 2, replace=False):
        size[begin : begin + 8] = 7.0
    return size * lot.standard_normal(n)
