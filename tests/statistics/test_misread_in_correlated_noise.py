"""One Maxwell mode in noise correlated to 0.95, by closed forms: no fault of reading is there."""

import numpy as np
from discover.statistics.reading.misread import CLEAR, misread
from discover.statistics.reading.reading_faults import Reading
from scipy.optimize import least_squares
from scipy.signal import lfilter

TIMES = np.linspace(0.1, 8.0, 80)
RATES = (0.3, 1.0, 3.0)
FURTHER = np.geomspace(0.05, 16.0, 12)
# of the first 110 draws those in which the likeliest correlation of the noise alone finds a fault
DRAWS = (25, 29, 46, 62, 71, 85, 87, 103, 106)


def stress(run, modulus, time):
    """σ12 of start-ups, and of the rate 2 cos t from rest."""
    if run < len(RATES):
        return modulus * time * RATES[run] * -np.expm1(-TIMES / time)
    wave = np.cos(TIMES) + time * np.sin(TIMES) - np.exp(-TIMES / time)
    return 2.0 * modulus * time / (1 + time**2) * wave


def readings(seed, correlation, size, factors=(1.0,) * 4):
    """Return four runs as the mode that fits them has them."""
    lot, records = np.random.default_rng([seed, 3]), []
    for run, factor in enumerate(factors):
        exact = factor * stress(run, 100.0, 1.0)
        steps = np.sqrt(1 - correlation**2) * lot.standard_normal(len(TIMES) + 200)
        noise = lfilter([1.0], [1.0, -correlation], steps)[200:]
        records.append(exact + size * np.sqrt(np.mean(exact**2)) * noise)
    sizes = [np.sqrt(np.mean(record**2)) for record in records]

    def left(logs):
        own = [stress(run, *np.exp(logs)) - record for run, record in enumerate(records)]
        return np.concatenate([row / size for row, size in zip(own, sizes, strict=True)])

    modulus, time = np.exp(least_squares(left, np.log([100.0, 1.0])).x)
    found = []
    for run, record in enumerate(records):
        own, step = stress(run, modulus, time), 1e-4 * time
        slope = (stress(run, modulus, time + step) - stress(run, modulus, time - step)) / (2 * step)
        modes = np.array([stress(run, modulus, other) for other in FURTHER])
        columns = np.array([own / modulus, slope])
        found.append(Reading(TIMES, own, own - record, columns, further=(modes, FURTHER)))
    return found


def test_strongly_correlated_noise_is_no_fault_of_reading():
    found = [misread(readings(seed, 0.95, 0.02)) for seed in DRAWS]
    assert all(one.probability > CLEAR for one in found)


def test_factors_that_are_there_are_seen_beside_white_and_correlated_noise():
    factors = (1.03, 0.97, 1.03, 0.97)
    for correlation in (0.0, 0.5):
        found = [misread(readings(seed, correlation, 0.02, factors)) for seed in DRAWS[:5]]
        assert all(one.probability <= CLEAR for one in found)
