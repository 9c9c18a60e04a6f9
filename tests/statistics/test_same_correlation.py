"""Noise of one instrument is correlated alike in all runs; a misfit is where the law fails."""

import numpy as np
import pytest
from scipy.signal import lfilter

from discover.protocols import start_up, steady_rates
from discover.protocols.between_samples import sampling_interval
from discover.statistics import lack_of_fit
from discover.statistics.noise.same_correlation import same_correlation_probability
from discover.statistics.noise.whiteness import SIGNIFICANCE

LENGTHS = (80, 80, 120)
EVERY = 0.1
DRAWS = 150


def noise(correlation, n, lot, size=1.0):
    drawn = size * lot.standard_normal(n)
    drawn[0] /= np.sqrt(1.0 - correlation**2)
    return lfilter([1.0], [1.0, -correlation], drawn)


def share_doubted(correlations, intervals, size=lambda n: 1.0, level=SIGNIFICANCE):
    doubted = 0
    for seed in range(DRAWS):
        lot = np.random.default_rng(seed)
        every = zip(correlations, LENGTHS, strict=True)
        rows = [noise(c, n, lot, size(n)) for c, n in every]
        doubted += same_correlation_probability(rows, intervals) <= level
    return doubted / DRAWS


@pytest.mark.parametrize("correlation", [0.0, 0.6, 0.9])
def test_noise_of_one_correlation_is_doubted_as_rarely_as_the_level_says(correlation):
    # of 150 draws at 1 %: more than 6 come once in 2000 times
    assert share_doubted([correlation] * 3, [EVERY] * 3) <= 6 / DRAWS


def test_noise_louder_in_some_stretches_is_not_doubted_for_that():
    def size(n):
        return np.abs(np.cos(np.linspace(0.0, 12.0, n))) + 0.02

    assert share_doubted([0.6] * 3, [EVERY] * 3, size) <= 6 / DRAWS


def test_a_correlation_of_one_run_alone_is_doubted():
    # as of a misfit that varies as slowly as that, beside noise of two runs
    assert share_doubted((0.2, 0.25, 0.7), [EVERY] * 3, level=SIGNIFICANCE / 8) > 0.7


@pytest.mark.parametrize("sparse", [0.8, 0.8**4])
def test_noise_correlated_from_sample_to_sample_or_over_time_is_no_misfit(sparse):
    # one run is sampled a fourth as often
    assert share_doubted((0.8, sparse, 0.8), (EVERY, 4 * EVERY, EVERY)) <= 6 / DRAWS


def test_what_is_recorded_otherwise_says_nothing_of_the_noise():
    lot = np.random.default_rng(0)
    rows = [noise(c, 200, lot) for c in (0.0, 0.9)]
    assert same_correlation_probability(rows, [EVERY, EVERY]) < 1e-6
    assert same_correlation_probability(rows, [EVERY, float("nan")]) == 1.0
    times = np.linspace(EVERY, 8.0, 80)
    assert sampling_interval(times, start_up(1.0)) == pytest.approx(EVERY)
    assert np.isnan(sampling_interval(times, start_up(1.0), "N1"))
    assert np.isnan(sampling_interval(np.arange(1.0, 9.0), steady_rates(np.geomspace(0.1, 1.0, 8))))


def test_a_law_that_leaves_correlated_noise_in_one_run_alone_does_not_explain():
    found = {}
    for case, correlations in {"alike": (0.5, 0.5, 0.5), "one": (0.2, 0.2, 0.6)}.items():
        lot = np.random.default_rng(2)
        rows = [
            0.01 * noise(c, n, lot) * np.sqrt(1.0 - c**2)
            for c, n in zip(correlations, LENGTHS, strict=True)
        ]
        records = [1.0 + np.sin(np.linspace(0.0, 3.0, n)) for n in LENGTHS]
        found[case] = lack_of_fit(rows, records, intervals=[EVERY] * 3)
        without = lack_of_fit(rows, records)
        assert without.verdict == "explained"
    assert found["alike"].verdict == "explained"
    assert found["one"].verdict == "unexplained"
    # what changes from sample to sample is all that is still called noise
    assert found["one"].noise < found["alike"].noise
