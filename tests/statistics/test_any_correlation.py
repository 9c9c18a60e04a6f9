"""Zeros of runs in correlated noise by scipy: as rare as is said, and seen where they are there."""

import numpy as np
import pytest
from discover.statistics.reading.any_correlation import probability_over_correlations
from scipy.signal import lfilter

RUNS, SAMPLES, DRAWS = 4, 80, 100
ROWS = np.split(np.arange(RUNS * SAMPLES), RUNS)
ZEROS = np.kron(np.eye(RUNS), np.ones((SAMPLES, 1)))
TREND = np.tile(np.linspace(0.0, 1.0, SAMPLES), RUNS)[:, None]


def noise(correlation, seed, sizes=(1.0,) * RUNS):
    lot = np.random.default_rng([seed, 1])
    steps = np.sqrt(1 - correlation**2) * lot.standard_normal((RUNS, SAMPLES + 300))
    drawn = lfilter([1.0], [1.0, -correlation], steps, axis=1)[:, 300:]
    return (np.array(sizes)[:, None] * drawn).ravel()


def probabilities(correlation, sizes=(1.0,) * RUNS, zero=0.0):
    put = zero * ZEROS @ np.array([1.0, -1.0, 1.0, -1.0])
    return np.array(
        [
            probability_over_correlations(ZEROS, TREND, noise(correlation, s, sizes) + put, ROWS)
            for s in range(DRAWS)
        ]
    )


# of 100 draws at one in ten more than 20 come once in 1000 times, and at one in a thousand more
# than 2. Runs of 80 samples hardly tell a correlation of 0.98 from a random walk
@pytest.mark.parametrize(
    ("correlation", "most"),
    [
        (0.0, 20),
        pytest.param(0.5, 20, marks=pytest.mark.slow),
        (0.9, 20),
        pytest.param(0.95, 20, marks=pytest.mark.slow),
        (0.98, 30),
    ],
)
def test_noise_alone_is_described_as_rarely_as_is_said(correlation, most):
    found = probabilities(correlation)
    assert np.count_nonzero(found <= 0.1) <= most
    assert np.count_nonzero(found <= 1e-3) <= 2


def test_noise_of_unlike_sizes_is_described_as_rarely():
    found = probabilities(0.0, (1.0, 0.1, 3.0, 1.0))
    assert 2 <= np.count_nonzero(found <= 0.1) <= 20


# of 80 samples a zero is known to 0.11 of white noise, and to some 0.2 where that is correlated
@pytest.mark.parametrize(("correlation", "zero"), [(0.0, 0.6), (0.5, 1.0)])
def test_zeros_that_are_there_are_seen(correlation, zero):
    assert np.mean(probabilities(correlation, zero=zero) < 1e-4) > 0.9


def test_strong_correlation_hides_what_it_may_do_itself():
    assert np.mean(probabilities(0.95, zero=0.6) < 1e-4) < 0.05


def test_what_leaves_nothing_is_no_chance():
    record = ZEROS @ np.arange(1.0, 5.0)
    assert probability_over_correlations(ZEROS, TREND, record, ROWS) == 0.0
