"""How many independent samples a correlated sequence is worth."""

import numpy as np
import pytest
from independent.noise import correlated

from discover.statistics import independent_samples


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
