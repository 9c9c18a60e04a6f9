"""Noise: what correlated samples are worth, which are outliers, what residuals hold beside it."""

import numpy as np
import pytest
from independent.noise import correlated, rms
from scipy.integrate import solve_ivp

from discover.statistics import independent_samples, whiteness
from discover.statistics.outliers import isolated_outliers


def test_noise_is_worth_what_its_correlation_leaves_and_a_trend_a_few_samples():
    generator = np.random.default_rng(0)
    worth = [independent_samples(generator.standard_normal(400)) for _ in range(50)]
    # a chance correlation of neighbours is counted when positive: some 5 % less
    assert np.mean(worth) == pytest.approx(400, rel=0.1)
    generator = np.random.default_rng(1)
    drawn = (correlated(np.ones(2000), 1.0, 0.6, generator) - 1.0 for _ in range(50))
    worth = [independent_samples(noise) for noise in drawn]
    # n (1 − ρ)/(1 + ρ); one sequence scatters by a tenth
    assert np.mean(worth) == pytest.approx(2000 * 0.4 / 1.6, rel=0.1)
    assert independent_samples(np.linspace(-1.0, 1.0, 1000)) < 5.0
    assert independent_samples(np.zeros(7)) == 7.0


@pytest.mark.parametrize("samples", [120, 400, 3000])
def test_a_smooth_wave_is_worth_its_swings_however_densely_sampled(samples):
    time = np.linspace(0.0, 1.0, samples, endpoint=False)
    # of a wave the correlation is a cosine: its sum to the first zero is 1/π of a period on both
    # sides together, so each of the 15 periods counts π times
    assert independent_samples(np.sin(2 * np.pi * 15 * time)) == pytest.approx(15 * np.pi, rel=0.1)


WHEN = np.linspace(0.05, 10.0, 200)
WAVE = np.sin(2.0 * WHEN)


def of_noise(rho, generator, size=0.02, n=200):
    return size * (correlated(np.ones(n), 1.0, rho, generator) - 1.0)


@pytest.mark.parametrize("share", [0.02, 0.05])
def test_spikes_of_thirty_times_the_noise_are_found(share):
    generator = np.random.default_rng(0)
    found = there = 0
    for _ in range(10):
        off = generator.random(200) < share
        off[:3] = off[-3:] = False
        spikes = 0.02 * 30.0 * off * generator.choice([-1.0, 1.0], 200)
        record = WAVE + of_noise(0.0, generator) + spikes
        found += np.count_nonzero(isolated_outliers(record) & off)
        there += np.count_nonzero(off)
    # some stand side by side, and cannot be told from something real
    assert found > 0.7 * there


@pytest.mark.parametrize("correlation", [0.0, 0.9])
@pytest.mark.parametrize("size", [1.0, np.abs(WAVE), 1.0 + (WHEN > 5.0)], ids=["", "prop", "step"])
def test_noise_has_fewer_than_one_outlier_in_a_thousand_samples(correlation, size):
    generator = np.random.default_rng(1)
    count = 0
    for _ in range(20):
        noise = size * of_noise(correlation, generator)
        count += np.count_nonzero(isolated_outliers(WAVE + noise))
    assert count <= 4  # of 4000


@pytest.mark.parametrize("samples", [15, 40, 200])
@pytest.mark.parametrize("noise", [0.0, 0.005])
def test_peaks_and_steps_are_no_outliers(samples, noise):
    time = np.linspace(0.0, 10.0, samples)
    generator = np.random.default_rng(2)
    # σ' = γ̇ − σ − ε σ³ (a law that overshoots with its structure), by scipy, and dry friction
    change = lambda t, y: [3.0 * y[1] - y[0], -2.0 * (y[1] - 0.2)]  # noqa: E731
    peak = solve_ivp(change, (0.0, 10.0), [0.0, 3.0], t_eval=time, rtol=1e-8).y[0]
    friction = np.sin(2.0 * time) + 0.4 * np.sign(np.cos(2.0 * time))
    for record in (peak, friction, np.abs((time % 2.0) - 1.0)):
        drawn = record + noise * generator.standard_normal(samples)
        assert not np.any(isolated_outliers(drawn))


@pytest.mark.parametrize("at", [1, 2, -3, -2, -1])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_knock_near_an_end_is_an_outlier(at, sign):
    record = WAVE + of_noise(0.0, np.random.default_rng(3))
    record[at] += sign * 30.0 * 0.02
    assert np.flatnonzero(isolated_outliers(record)).tolist() == [at % 200]


@pytest.mark.parametrize("ringing", [1, 3, 8])
def test_what_rings_at_the_start_is_no_outlier(ringing):
    """An instrument that settles in a few samples: what is off in them is real."""
    record = WAVE + of_noise(0.0, np.random.default_rng(2))
    record[:ringing] += 30.0 * 0.02 * 0.8 ** np.arange(ringing) * (-1.0) ** np.arange(ringing)
    assert not np.any(isolated_outliers(record)[:ringing])


def test_what_gives_way_at_the_end_is_no_outlier():
    record = WAVE + of_noise(0.0, np.random.default_rng(2))
    record[-4:] -= 30.0 * 0.02 * np.arange(1.0, 5.0)
    assert not np.any(isolated_outliers(record))


@pytest.mark.parametrize("correlation", [0.0, 0.9])
def test_noise_and_what_ends_suddenly_are_no_outliers_near_an_end(correlation):
    """A motor that stops two samples before the end, a stress that levels off, a first sample."""
    generator = np.random.default_rng(5)
    growing = np.exp(0.3 * np.arange(40.0))
    growing[-1] = growing[-2]
    stopped = np.append(1.0 - np.exp(-WHEN[:-2]), [0.4, 0.2])
    started = np.append([0.7], 1.0 - np.exp(-WHEN))
    for record in (WAVE, 1.0 - np.exp(-WHEN), growing, stopped, started):
        size = 0.02 * np.minimum(np.abs(record), 1.0)
        for _ in range(50):
            noise = size * of_noise(correlation, generator, 1.0, len(record))
            assert not np.any(isolated_outliers(record + noise)[[0, 1, 2, -3, -2, -1]])


def test_samples_that_read_zero_are_outliers_unless_the_stress_passes_or_rests_there():
    record = 1.0 - np.exp(-WHEN) + of_noise(0.0, np.random.default_rng(6))
    dropped = [20, 21, 30, 32, 33, 34, 100]
    record[dropped] = 0.0
    assert np.flatnonzero(isolated_outliers(record)).tolist() == dropped
    # records without noise that read exactly zero: a wave, a cusp, a rest before the flow
    wave = np.round(np.sin(0.1 * np.pi * np.arange(200)), 12)
    cusp = np.abs(np.arange(-100.0, 100.0)) / 100.0
    rest = np.append(np.zeros(30), 1.0 - np.exp(-WHEN))
    for record in (wave, cusp, rest):
        assert not np.any(isolated_outliers(record))


def test_the_noise_of_a_smooth_misfit_is_not_its_size():
    noise = 0.01 * np.random.default_rng(0).standard_normal(400)
    trend = 0.2 * np.sin(np.linspace(0, 6, 400))
    assert whiteness.sample_to_sample_noise(noise) == pytest.approx(0.01, rel=0.2)
    assert whiteness.sample_to_sample_noise(noise + trend) == pytest.approx(0.01, rel=0.2)
    # a run of three samples does not tell, and none is noisier than it may be
    rows = [noise + trend, noise[:3], noise]
    np.testing.assert_allclose(
        whiteness.fast_noise(rows, np.array([1.0, 0.3, 1e-3])), [0.01, 0.3, 1e-3], rtol=0.2
    )


def test_separate_points_of_noise_agree_as_the_level_says_and_a_smooth_misfit_is_no_noise():
    generator = np.random.default_rng(2)
    # louder where the stress is large, as of a flow curve
    rows = [generator.standard_normal(n) * np.geomspace(1.0, 3.0, n) for n in [7, 12, 25] * 100]
    low = sum(whiteness.independence_probability([row]) <= 0.05 for row in rows)
    # 5 % of 300, within three standard deviations of a binomial count
    assert low <= 15 + 3 * np.sqrt(300 * 0.05 * 0.95)
    smooth = np.cos(np.linspace(0.0, 2.0 * np.pi, 20))
    left = 3.0 * smooth + np.random.default_rng(0).standard_normal(20)
    assert whiteness.independence_probability([left]) < 0.01


@pytest.mark.parametrize("misfit", [0.0, 1.0])
def test_six_short_series_show_a_misfit_as_large_as_their_noise(misfit):
    times, low = np.linspace(0.33, 5.0, 15), 0
    # start-ups of Maxwell fluids of the same viscosity, one 2 times as slow
    missed = np.exp(-times / 2.0) - np.exp(-times)
    missed *= misfit / rms(missed)
    for seed in range(20):
        noise = np.random.default_rng(seed).standard_normal((6, 15))
        low += whiteness.independence_probability([*(noise + missed)]) <= 0.01
    # 1 % of 20 by chance; one that is seen nine times in ten is missed more than five times of 20
    # once in 10,000
    assert low >= 15 if misfit else low <= 3


LOUD = 1.0 + 15.0 * np.exp(-np.linspace(0.0, 12.0, 121))


@pytest.mark.parametrize("rho", [0.0, 0.6, 0.9])
@pytest.mark.parametrize("size", [np.ones(121), LOUD], ids=["even", "loud start"])
def test_the_probability_is_one_whatever_the_noise(rho, size):
    drawn = []
    for seed in range(60):
        generator = np.random.default_rng(seed)
        rows = [size * correlated(np.ones(121), 1.0, rho, generator) for _ in range(3)]
        drawn.append(whiteness.smooth_misfit_probability([row - size for row in rows]))
    # 5 % of 60 is 3, and more than 9 has a probability of 0.1 %
    assert np.count_nonzero(np.array(drawn) < 0.05) <= 9
    assert np.count_nonzero(np.array(drawn) < 0.001) <= 1
