"""Noises that are neither white nor correlated alike, in records of fluids with and without a name.

Each noise is about 1 % of its record where nothing else is said.
"""

from collections.abc import Callable

import numpy as np
from hostile_fluids_materials import white
from hostile_fluids_records import (
    GIESEKUS,
    MOBILITY,
    POM_POM,
    SCALE,
    SQUARE,
    UCM,
    Case,
    Noise,
    recorded,
)
from hostile_fluids_textbook_cases import CASES as TEXTBOOK_AND_BEFORE
from independent import RoliePoly
from independent.noise import rms

_SIZE = 0.01
Shape = Callable[[int, np.random.Generator], np.ndarray]


def _heavy(n: int, lot: np.random.Generator) -> np.ndarray:
    return lot.standard_t(2.5, n)


def _one_sided(n: int, lot: np.random.Generator) -> np.ndarray:
    return lot.exponential(1.0, n) - 1.0


def _telegraph(n: int, lot: np.random.Generator) -> np.ndarray:
    """Return noise of a loose contact: two levels of some twelve samples each."""
    turns = lot.random(n) < 1.0 / 12.0
    return 1.5 * (-1.0) ** np.cumsum(turns) + 0.3 * lot.standard_normal(n)


def _pink(n: int, lot: np.random.Generator) -> np.ndarray:
    waves = np.fft.rfft(lot.standard_normal(n))
    waves[1:] /= np.sqrt(np.arange(1, len(waves)))
    waves[0] = 0.0
    noise = np.fft.irfft(waves, n)
    return noise / rms(noise)


def _growing(n: int, lot: np.random.Generator) -> np.ndarray:
    return np.linspace(0.2, 3.0, n) * lot.standard_normal(n)


def _bursts(n: int, lot: np.random.Generator) -> np.ndarray:
    """Return noise with two stretches of eight samples that are ten times as loud."""
    size = np.full(n, 0.7)
    for begin in lot.choice(np.arange(5, n - 12), 2, replace=False):
        size[begin : begin + 8] = 7.0
    return size * lot.standard_normal(n)


def _smoothed(n: int, lot: np.random.Generator) -> np.ndarray:
    """Return white noise three times as large, of which each sample is the mean of nine."""
    return 3.0 * np.convolve(lot.standard_normal(n + 8), np.full(9, 1.0 / 9.0), "valid")


def _wandering_gain(stress: np.ndarray, lot: np.random.Generator) -> np.ndarray:
    """Let the amplification wander by 1 % within a run, beside white noise of 0.5 %."""
    walk = np.cumsum(lot.standard_normal(len(stress))) / np.sqrt(0.5 * len(stress))
    return white(0.005)(stress * (1.0 + _SIZE * walk), lot)


def _dropouts(stress: np.ndarray, lot: np.random.Generator) -> np.ndarray:
    """Let one sample in twenty read zero."""
    return np.where(lot.random(len(stress)) < 0.05, 0.0, white(_SIZE)(stress, lot))


def _knocked_ends(stress: np.ndarray, lot: np.random.Generator) -> np.ndarray:
    """Knock the second and the last sample by 20 to 40 times the noise."""
    noisy = white(_SIZE)(stress, lot)
    noisy[[1, -1]] += _SIZE * rms(stress) * lot.uniform(20.0, 40.0, 2) * lot.choice([-1, 1], 2)
    return noisy


def _slow_update(stress: np.ndarray, lot: np.random.Generator) -> np.ndarray:
    """Read a transducer three times before it has a new value."""
    noisy = white(_SIZE)(stress, lot)
    return noisy[3 * (np.arange(len(stress)) // 3)]


def _uneven_clock(stress: np.ndarray, lot: np.random.Generator) -> np.ndarray:
    """Take samples up to half of an interval before or after their time."""
    at = np.arange(len(stress)) + lot.uniform(-0.5, 0.5, len(stress))
    return white(0.005)(np.interp(at, np.arange(len(stress)), stress), lot)


def _of(shape: Shape) -> Noise:
    return lambda stress, lot: stress + _SIZE * rms(stress) * shape(len(stress), lot)


NOISES: dict[str, tuple[str, Noise]] = {
    "heavy": ("with heavy tails", _of(_heavy)),
    "one_sided": ("to one side", _of(_one_sided)),
    "telegraph": ("of two levels", _of(_telegraph)),
    "pink": ("of all frequencies alike", _of(_pink)),
    "growing": ("that grows", _of(_growing)),
    "bursts": ("in bursts", _of(_bursts)),
    "smoothed": ("smoothed", _of(_smoothed)),
    "wandering": ("of the amplification", _wandering_gain),
    "dropouts": ("and dropouts", _dropouts),
    "knocked": ("and knocks near both ends", _knocked_ends),
    "slow_update": ("read three times", _slow_update),
    "uneven": ("of the clock", _uneven_clock),
}
"""In words, and as a function of the record."""

_FLUIDS = {
    "maxwell": ("Maxwell", UCM, {}),
    "giesekus": ("Giesekus", GIESEKUS, {"planted": MOBILITY, "terms": SQUARE}),
    "rolie_poly": ("Rolie–Poly", RoliePoly(0.7, 0.1, **SCALE), {"outside": True}),
    "pom_pom": ("pom-pom", POM_POM, {"outside": True}),
}
NOISY: dict[str, Case] = {
    f"noise_{noise}_{fluid}": Case(f"{truth}, noise {words}", recorded(material), put_on, **there)
    for noise, (words, put_on) in NOISES.items()
    for fluid, (truth, material, there) in _FLUIDS.items()
}

CASES: dict[str, Case] = {**TEXTBOOK_AND_BEFORE, **NOISY}
