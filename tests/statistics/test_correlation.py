"""Correlation of noise: of samples, runs and intervals."""

import numpy as np
import pytest
from scipy.signal import lfilter

from discover.protocols import start_up, steady_rates
from discover.protocols.between_samples import sampling_interval
from discover.statistics import independent_samples, lack_of_fit
from discover.statistics.noise.same_correlation import same_correlation_probability
from discover.statistics.noise.whiteness import SIGNIFICANCE


def test_white_noise_is_worth_its_samples():
    generator = np.random.default_rng(0)
    worth = [independent_samples(generator.standard_normal(400)) for _ in range(50)]
    # a chance correlation of neighbours is counted when positive: some 5 % less
    assert np.mean(worth) == pytest.approx(400, rel=0.1)


def test_autoregressive_noise_is_worth_what_its_correlation_leaves():
    generator = np.random.default_rng(1)
    worth = []
    for _ in range(50):
        noise = np.zeros(2000)
        for i in range(1, 2000):
            noise[i] = 0.6 * noise[i - 1] + generator.standard_normal()
        worth.append(independent_samples(noise))
    # n (1 − ρ)/(1 + ρ); one sequence scatters by a tenth
    assert np.mean(worth) == pytest.approx(2000 * 0.4 / 1.6, rel=0.1)


@pytest.mark.parametrize("samples", [120, 400, 3000])
def test_a_smooth_wave_is_worth_its_swings_however_densely_sampled(samples):
    time = np.linspace(0.0, 1.0, samples, endpoint=False)
    # of a wave the correlation is a cosine: its sum to the first zero is 1/π of a period on both
    # sides together, so each of the 15 periods counts π times
    assert independent_samples(np.sin(2 * np.pi * 15 * time)) == pytest.approx(15 * np.pi, rel=0.1)


def test_a_trend_is_worth_a_few_samples():
    assert independent_samples(np.linspace(-1.0, 1.0, 1000)) < 5.0


def test_nothing_at_all_is_worth_its_samples():
    assert independent_samples(np.zeros(7)) == 7.0


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
