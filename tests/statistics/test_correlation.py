"""Correlation of noise: of samples, runs and intervals."""

import numpy as np
import pytest
from scipy.signal import lfilter

from discover.protocols import start_up, steady_rates
from discover.protocols.between_samples import sampling_interval
from discover.statistics import independent_samples, lack_of_fit, least_squares_covariance
from discover.statistics.noise.same_correlation import same_correlation_probability
from discover.statistics.noise.whiteness import SIGNIFICANCE

NOISE = 0.01


def deviations(second):
    """Return the standard deviations of two amplitudes, (SᵀS)⁻¹ and S, with this second column."""
    times = np.linspace(0.0, 5.0, 60)
    columns = np.column_stack([np.sin(times), second(times)])
    residual = NOISE * np.random.default_rng(0).standard_normal(60)
    covariance, inverse, _ = least_squares_covariance(columns, residual, [np.arange(60)])
    return np.sqrt(np.diag(covariance)), inverse, columns


@pytest.mark.parametrize("second", [np.sin, lambda t: 3.0 * np.sin(t), np.zeros_like])
def test_an_amplitude_that_another_cancels_is_open_however_small_the_noise(second):
    found, inverse, _ = deviations(second)
    assert found[1] > 1e2 * NOISE
    # the pseudo-inverse, with which a known parameter is put in, stays finite and small
    assert np.max(np.abs(inverse)) < 1.0


def test_amplitudes_that_differ_keep_the_textbook_deviation():
    found, _, columns = deviations(np.cos)
    expected = NOISE * np.sqrt(np.diag(np.linalg.inv(columns.T @ columns)))
    # the noise is estimated from 60 samples: its size is known to a tenth
    np.testing.assert_allclose(found, expected, rtol=0.3)


def test_what_two_that_cancel_do_together_keeps_its_deviation():
    times = np.linspace(0.0, 5.0, 60)
    columns = np.column_stack([np.sin(times), np.sin(times)])
    residual = NOISE * np.random.default_rng(0).standard_normal(60)
    covariance, *_ = least_squares_covariance(columns, residual, [np.arange(60)])
    alone, *_ = least_squares_covariance(columns[:, :1], residual, [np.arange(60)])
    together = np.ones(2) @ covariance @ np.ones(2)
    # 58 and 59 degrees of freedom
    assert together == pytest.approx(alone[0, 0], rel=0.03)


def test_of_sensitivities_that_run_away_nothing_is_known_and_nothing_crashes():
    # a comparison of blood ended here, in eigenvalues of what is not a number
    columns = np.random.default_rng(0).normal(size=(40, 2))
    residual = np.random.default_rng(1).normal(size=40)
    rows = [np.arange(20), np.arange(20, 40)]
    columns[7, 1] = np.nan
    covariance, inverse, _ = least_squares_covariance(columns, residual, rows)
    assert np.all(np.isinf(covariance))
    assert np.all(np.isinf(inverse))
    columns[7, 1] = 0.0
    covariance, inverse, _ = least_squares_covariance(columns, residual, rows)
    assert np.all(np.isfinite(covariance))


@pytest.mark.parametrize("louder", [1.0, 0.1, 10.0])
def test_an_interval_from_a_short_run_is_that_of_its_own_noise_beside_long_ones(louder):
    """Weighted by one over the root of its samples, as a run is in a fit of the loop."""
    lengths = (24, 400, 400)
    sizes = [1.0 / np.sqrt(n) for n in lengths]
    ends = np.cumsum(lengths)
    sequences = [np.arange(end - n, end) for n, end in zip(lengths, ends, strict=True)]
    columns = np.zeros((ends[-1], 2))
    columns[:24, 0] = sizes[0]  # only the short run sees the first constant
    for rows, size in zip(sequences[1:], sizes[1:], strict=True):
        columns[rows, 1] = size
    noise = [NOISE * size for size in sizes]
    noise[0] *= louder
    rng = np.random.default_rng(0)
    held, widths = 0, []
    for _ in range(200):
        data = np.concatenate(
            [s * rng.standard_normal(n) for s, n in zip(noise, lengths, strict=True)]
        )
        found, *_ = np.linalg.lstsq(columns, data, rcond=None)
        covariance, *_ = least_squares_covariance(
            columns, data - columns @ found, sequences, sizes=sizes
        )
        widths.append(np.sqrt(covariance[0, 0]))
        held += abs(found[0]) < 1.96 * widths[-1]
    # 95 % of 200, less three standard deviations of a binomial number, and what 24 samples leave
    # open of the noise
    assert held > 178
    assert np.median(widths) == pytest.approx(louder * NOISE / np.sqrt(24), rel=0.1)


def test_runs_of_one_length_keep_their_covariance_whatever_the_size_of_their_weights():
    rng = np.random.default_rng(1)
    columns, residual = rng.normal(size=(40, 2)), rng.normal(size=40)
    rows = [np.arange(20), np.arange(20, 40)]
    plain, *_ = least_squares_covariance(columns, residual, rows)
    sized, *_ = least_squares_covariance(columns, residual, rows, sizes=[0.2, 0.2])
    np.testing.assert_allclose(sized, plain, rtol=1e-12)


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
