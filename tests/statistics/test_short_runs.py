"""Runs too short to be tested alone are tested together."""

import numpy as np
import pytest

from discover.statistics.lack_of_fit import what_is_left
from discover.statistics.noise.whiteness import noise_probability
from discover.statistics.residual import noise_floor

TIMES = np.linspace(0.33, 5.0, 15)


def noise(generator, runs=6, samples=15):
    return 0.01 * generator.standard_normal((runs, samples))


def structured(residual, weight):
    probability = noise_probability(residual, weight)
    assert probability is not None
    return probability <= 0.01


def test_plain_noise_of_short_runs_is_taken_for_structure_as_seldom_as_the_level_says():
    weight = np.ones((6, 15))
    taken = sum(structured(noise(np.random.default_rng(seed)), weight) for seed in range(300))
    # 1 % of 300, within three standard deviations of a binomial count
    assert taken <= 3 + 3 * np.sqrt(300 * 0.01 * 0.99)


def test_few_short_runs_of_noise_are_explained():
    records = [np.ones(12)] * 3
    verdicts = [
        what_is_left(list(noise(np.random.default_rng(seed), 3, 12)), records).verdict
        for seed in range(60)
    ]
    # 1 % of 60: more than 4 has a probability below 1e-3
    assert verdicts.count("explained") >= 56


def test_six_runs_of_fifteen_samples_show_a_misfit_as_large_as_their_noise():
    # start-ups of Maxwell fluids of the same viscosity, one 2 times as slow
    misfit = np.exp(-TIMES / 2.0) - np.exp(-TIMES)
    misfit *= 0.01 / np.sqrt(np.mean(misfit**2))
    records = [-np.expm1(-TIMES)] * 6
    found = [
        what_is_left(list(noise(np.random.default_rng(seed)) + misfit), records).verdict
        for seed in range(20)
    ]
    # a misfit that is seen nine times in ten is missed more than five times of 20 once in 10,000
    assert found.count("unexplained") >= 15


def test_what_short_runs_cannot_tell_is_said():
    # no larger than a pattern of noise may be, and yet a pattern
    bent = 0.008 * np.cos(np.linspace(0.0, np.pi, 15))
    residuals = list(bent + noise(np.random.default_rng(1)))
    assert "do not tell correlated noise" in what_is_left(residuals, [np.ones(15)] * 6).reason
    # changes from sample to sample, as noise does
    few = what_is_left([0.01 * (-1.0) ** np.arange(8)] * 2, [np.ones(8)] * 2)
    assert few.probability is None
    assert "too few samples" in few.reason
    # 8 samples of plain noise look like more than noise one time in five
    row = noise(np.random.default_rng(0), 1, 8)[0] + np.linspace(-0.1, 0.1, 8)
    open_ = what_is_left([row], [np.ones(8)])
    assert open_.verdict == "unexplained"
    assert "hardly tell" in open_.reason
    assert "hardly tell" not in what_is_left([row] * 3, [np.ones(8)] * 3).reason


def test_longer_runs_tell_short_ones_how_correlated_their_noise_is():
    def correlated(n, generator):
        drawn = generator.standard_normal(n)
        for i in range(1, n):
            drawn[i] = 0.7 * drawn[i - 1] + np.sqrt(0.51) * drawn[i]
        return drawn

    weight = np.zeros((7, 200))
    weight[0], weight[1:, :15] = 1.0, 1.0
    alone, together = 0, 0
    for seed in range(20):
        generator = np.random.default_rng(seed)
        residual = np.zeros((7, 200))
        residual[0] = correlated(200, generator)
        residual[1:, :15] = [correlated(15, generator) for _ in range(6)]
        alone += structured(residual[1:], weight[1:])
        together += structured(residual, weight)
    assert alone >= 18
    # 1 % of 20: more than 3 has a probability below 1e-4
    assert together <= 3


def test_the_noise_of_short_runs_is_their_size_where_nothing_speaks_against_it():
    residual = noise(np.random.default_rng(1)) / np.sqrt(15)
    # 90 samples: 7 % standard error
    assert noise_floor(residual, np.full((6, 15), 1 / np.sqrt(15))) == pytest.approx(0.01, rel=0.2)
