"""A law that is nearly right leaves a smooth misfit: it is not taken for slow noise."""

import numpy as np
import pytest
from independent import Giesekus, Modes, UpperConvectedMaxwell, oscillation, start_up
from independent.noise import correlated, proportional, rms, white

from discover.statistics import lack_of_fit
from discover.statistics.noise.smooth_misfit import smooth_misfit_probability

GROWTH, WAVE = np.geomspace(0.05, 10.0, 60), np.linspace(0.0, 12.0, 121)
FLOWS = [(start_up(0.5), GROWTH), (start_up(2.0), GROWTH), (oscillation(2.0, 1.0), WAVE)]
TWO = Modes(Giesekus(0.1, 80.0, 1.0), Giesekus(0.7, 60.0, 0.1))
NEAR = Modes(Giesekus(0.1, 80.0, 1.0), UpperConvectedMaxwell(54.0, 0.1))


@pytest.fixture(scope="module")
def stresses():
    """σ12 of a fluid of two modes, and of one that is nearly it."""
    return [[material.respond(*flow).sigma12 for flow in FLOWS] for material in (TWO, NEAR)]


def said(exact, predicted, noise, seed):
    generator = np.random.default_rng(seed)
    records = [noise(row, generator) for row in exact]
    residuals = [row - record for row, record in zip(predicted, records, strict=True)]
    return lack_of_fit(residuals, records).verdict


NOISES = {
    "white": lambda row, generator: white(row, 0.01, generator),
    "slow": lambda row, generator: correlated(row, 0.03, 0.9, generator),
    "less slow": lambda row, generator: correlated(row, 0.03, 0.6, generator),
    "proportional": lambda row, generator: proportional(row, 0.05, generator),
}


@pytest.mark.slow
def test_a_smooth_misfit_larger_than_the_noise_is_no_slow_noise(stresses):
    exact, near = stresses
    # two to three times the noise: so much correlated noise would explain, were it not for its form
    misses = [rms(one - other) / rms(one) for one, other in zip(exact, near, strict=True)]
    assert 0.008 < np.mean(misses) < 0.04
    verdicts = [said(exact, near, NOISES["white"], seed) for seed in range(20)]
    assert verdicts.count("unexplained") >= 18


@pytest.mark.parametrize("noise", NOISES.values(), ids=NOISES)
def test_the_law_that_made_the_data_leaves_noise(stresses, noise):
    verdicts = [said(stresses[0], stresses[0], noise, seed) for seed in range(20)]
    # significance 0.01: more than 2 of 20 has a probability of 0.001
    assert verdicts.count("explained") >= 18


LOUD = 1.0 + 15.0 * np.exp(-WAVE)


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
