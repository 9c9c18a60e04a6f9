"""A sweep excuses what its moduli may change in records, and no other pattern: closed forms."""

import numpy as np
import pytest
from discover.statistics.reading.beyond_sweep import beyond_the_sweep
from discover.statistics.reading.reading_faults import Reading

from discover.dataset import LinearSweep
from discover.dataset.linear_viscoelasticity import relaxation_spectrum
from discover.statistics.residual import Expectation

TIMES = np.geomspace(0.02, 8.0, 100)
RATES = (0.3, 1.0, 3.0)
MODULI, RELAXATION = np.array([20.0, 60.0, 120.0]), np.array([10.0, 1.0, 0.1])
ERROR = 0.02


def of_modes(rate, moduli, times):
    """σ12 of Maxwell modes when shear starts."""
    return (moduli * times * rate) @ -np.expm1(-TIMES / times[:, None])


def readings(seed, extra=None, off=0.0):
    """Runs of three modes with 0.5 % of noise, the moduli off and one more mode in the records."""
    lot = np.random.default_rng(seed)
    wrong = MODULI * (1 + off * ERROR * lot.standard_normal(3))
    found = []
    for rate in RATES:
        predicted = of_modes(rate, MODULI, RELAXATION)
        record = of_modes(rate, wrong, RELAXATION)
        if extra is not None:
            record = record + of_modes(rate, np.array([extra]), np.array([0.02]))
        size = 0.005 * np.sqrt(np.mean(record**2))
        record = record + size * lot.standard_normal(len(TIMES))
        shared = np.array([ERROR * g * rate * t * -np.expm1(-TIMES / t)
                           for g, t in zip(MODULI, RELAXATION, strict=True)])  # fmt: skip
        found.append(
            Reading(TIMES, predicted, predicted - record, np.zeros((0, len(TIMES))), shared=shared)
        )
    return found


@pytest.mark.parametrize("seed", range(8))
def test_moduli_that_are_off_as_far_as_the_sweep_allows_are_excused(seed):
    assert beyond_the_sweep(readings(seed, off=1.0), Expectation(linear_error=ERROR), 0.0) is None


@pytest.mark.parametrize("seed", range(4))
def test_a_mode_beyond_the_sweep_is_not_excused_by_its_error(seed):
    runs = readings(seed, extra=60.0)
    beyond = beyond_the_sweep(runs, Expectation(linear_error=ERROR), 0.0)
    assert beyond is not None
    assert beyond.verdict == "unexplained"
    # where the sweep itself shows a pattern as large, of modes that are too few, it is
    assert beyond_the_sweep(runs, Expectation(linear_error=ERROR), 0.9 * ERROR) is None
    # and without an error of the sweep nothing is asked: what is left is judged as it is
    assert beyond_the_sweep(runs, Expectation(), 0.0) is None


def swept(noise, count, seed=0, **options):
    lot, omega = np.random.default_rng(seed), np.geomspace(0.01, 100.0, 33)
    times = np.geomspace(30.0, 0.03, count)
    x = omega[:, None] * times
    storage, loss = (x**2 / (1 + x**2)).sum(axis=1), (x / (1 + x**2)).sum(axis=1)
    rough = 1 + noise * lot.standard_normal((2, len(omega)))
    return relaxation_spectrum(LinearSweep(omega, storage * rough[0], loss * rough[1]), **options)


def test_what_modes_miss_of_a_sweep_is_noise_or_the_pattern_of_modes_too_few():
    patterns = [swept(0.02, 3, seed).pattern for seed in range(12)]
    assert np.median(patterns) < 0.008
    assert max(patterns) < 0.02
    few = swept(0.005, 9, most_modes=5)
    assert 0.8 * few.relative_error < few.pattern <= few.relative_error


def test_a_sweep_that_no_modes_follow_excuses_nothing():
    told = Expectation(linear_error=ERROR)
    for seed in range(1, 5):
        runs = readings(seed, off=1.0)
        assert beyond_the_sweep(runs, told, 0.0) is None
        beyond = beyond_the_sweep(runs, told, None)
        assert beyond is not None
        assert beyond.verdict == "unexplained"
        # what is noise needs no excuse
        assert beyond_the_sweep(readings(seed), told, None) is None
