"""How many independent samples a correlated sequence is worth."""

import numpy as np
import pytest

from discover.statistics import independent_samples


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
