"""Tests of residuals for noise: what is fast, smooth, or agrees with its neighbours."""

import numpy as np
import pytest
from independent.noise import correlated, rms

from discover.statistics.noise.whiteness import separate_probability, smooth_misfit_probability
from discover.statistics.residual import fast_part, noise_beside


def test_the_noise_of_a_smooth_misfit_is_not_its_size():
    noise = 0.01 * np.random.default_rng(0).standard_normal(400)
    trend = 0.2 * np.sin(np.linspace(0, 6, 400))
    assert fast_part(noise) == pytest.approx(0.01, rel=0.2)
    assert fast_part(noise + trend) == pytest.approx(0.01, rel=0.2)
    # a run of three samples does not tell, and none is noisier than it may be
    rows = [noise + trend, noise[:3], noise]
    np.testing.assert_allclose(
        noise_beside(rows, np.array([1.0, 0.3, 1e-3])), [0.01, 0.3, 1e-3], rtol=0.2
    )


def test_separate_points_of_noise_agree_as_the_level_says_and_a_smooth_misfit_is_no_noise():
    generator = np.random.default_rng(2)
    # louder where the stress is large, as of a flow curve
    rows = [generator.standard_normal(n) * np.geomspace(1.0, 3.0, n) for n in [7, 12, 25] * 100]
    low = sum(separate_probability([row]) <= 0.05 for row in rows)
    # 5 % of 300, within three standard deviations of a binomial count
    assert low <= 15 + 3 * np.sqrt(300 * 0.05 * 0.95)
    smooth = np.cos(np.linspace(0.0, 2.0 * np.pi, 20))
    left = 3.0 * smooth + np.random.default_rng(0).standard_normal(20)
    assert separate_probability([left]) < 0.01


@pytest.mark.parametrize("misfit", [0.0, 1.0])
def test_six_short_series_show_a_misfit_as_large_as_their_noise(misfit):
    times, low = np.linspace(0.33, 5.0, 15), 0
    # start-ups of Maxwell fluids of the same viscosity, one 2 times as slow
    missed = np.exp(-times / 2.0) - np.exp(-times)
    missed *= misfit / rms(missed)
    for seed in range(20):
        noise = np.random.default_rng(seed).standard_normal((6, 15))
        low += separate_probability([*(noise + missed)]) <= 0.01
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
        drawn.append(smooth_misfit_probability([row - size for row in rows]))
    # 5 % of 60 is 3, and more than 9 has a probability of 0.1 %
    assert np.count_nonzero(np.array(drawn) < 0.05) <= 9
    assert np.count_nonzero(np.array(drawn) < 0.001) <= 1
