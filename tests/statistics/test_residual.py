"""When is a residual noise, and when is something missing."""

import numpy as np
import pytest
from independent.noise import correlated

from discover.statistics.noise.whiteness import noise_probability
from discover.statistics.residual import (
    Expectation,
    is_noise,
    judging,
    noise_floor,
    tells_noise,
)

RUNS, SAMPLES = 6, 60
WEIGHT = np.full((RUNS, SAMPLES), 1 / np.sqrt(SAMPLES))
PHASE = np.linspace(0.0, 6.0, SAMPLES)


def noise(correlation=0.0, seed=0, size=0.01):
    lot, still = np.random.default_rng(seed), np.ones(SAMPLES)
    drawn = np.array([correlated(still, size, correlation, lot) - still for _ in range(RUNS)])
    return drawn / np.sqrt(SAMPLES)


@pytest.mark.parametrize("correlation", [pytest.param(0.0, marks=pytest.mark.slow), 0.6])
def test_noise_is_rarely_taken_for_structure(correlation):
    taken = [not is_noise(noise(correlation, seed), WEIGHT) for seed in range(100)]
    # significance 0.001: more than 3 of 100 has a probability below 1e-5
    assert sum(taken) <= 3


@pytest.mark.parametrize("correlation", [0.0, 0.6])
@pytest.mark.parametrize(
    "pattern",
    [np.sin(PHASE), np.sin(12 * PHASE), np.sign(np.cos(3 * PHASE)), np.exp(-PHASE)],
    ids=["smooth", "hum", "friction", "decay"],
)
def test_a_pattern_three_times_the_noise_is_structure(pattern, correlation):
    pattern = 0.03 * pattern / np.sqrt(np.mean(pattern**2)) / np.sqrt(SAMPLES)
    missed = [is_noise(noise(correlation, seed) + pattern, WEIGHT) for seed in range(20)]
    assert sum(missed) == 0


def test_runs_of_a_few_samples_say_nothing():
    assert noise_probability(np.ones((3, 7)), np.ones((3, 7))) is None


@pytest.mark.parametrize("correlation", [0.0, 0.6])
def test_the_floor_is_the_size_of_the_noise_correlated_or_not(correlation):
    # 360 samples, of which the correlation leaves 90: 7 % standard error
    assert noise_floor(noise(correlation), WEIGHT) == pytest.approx(0.01, rel=0.2)


def test_what_a_model_may_leave_is_noise_and_the_error_of_the_linear_data():
    smooth = np.tile(0.02 * np.sin(PHASE), (RUNS, 1)) / np.sqrt(SAMPLES)
    left = noise() + smooth
    assert not Expectation().explains(left, WEIGHT)
    assert Expectation(linear_error=0.02).explains(left, WEIGHT)
    # an error of the linear data that is far smaller does not excuse it
    assert not Expectation(linear_error=0.002).explains(left, WEIGHT)
    # nor does a noise that is given, unless it is as large as the whole
    assert Expectation(noise=0.02).explains(left, WEIGHT)
    assert not Expectation(noise=0.015).explains(left, WEIGHT)
    assert not Expectation(noise=0.005).explains(left, WEIGHT)


def test_what_repeated_runs_differ_by_may_have_a_pattern_of_its_size_and_no_more():
    smooth = np.tile(0.02 * np.sin(PHASE), (RUNS, 1)) / np.sqrt(SAMPLES)
    left = noise() + smooth  # the pattern is 1.4 %, the noise 1 %
    assert Expectation(repeat_error=0.02).explains(left, WEIGHT)
    assert not Expectation(repeat_error=0.01).explains(left, WEIGHT)
    # what is left may be as large as before, and no pattern beyond it
    assert not Expectation(repeat_error=0.02).explains(noise() + 3.0 * smooth, WEIGHT)


def with_a_short_run(samples, miss):
    """Return noise of two long runs and a shorter one that is missed by so much, with weights."""
    residual, weight = noise()[:3].copy(), WEIGHT[:3].copy()
    residual[2], weight[2] = 0.0, 0.0
    residual[2, :samples], weight[2, :samples] = miss / np.sqrt(samples), 1.0 / np.sqrt(samples)
    return residual, weight


@pytest.mark.parametrize("samples", [1, 3, 6])
def test_a_run_of_a_few_samples_decides_nothing_beside_longer_ones(samples):
    residual, weight = with_a_short_run(samples, 0.3)
    assert judging(weight).tolist() == [True, True, False]
    assert noise_floor(residual, weight) == pytest.approx(0.01, rel=0.2)
    assert Expectation().explains(residual, weight)


def test_the_size_of_a_run_too_short_to_be_tested_is_no_sign_of_noise():
    residual, weight = with_a_short_run(15, 0.3)
    assert noise_floor(residual, weight) == pytest.approx(0.01, rel=0.2)
    assert not Expectation().explains(residual, weight)
    residual, weight = with_a_short_run(15, 0.01)
    assert Expectation().explains(residual, weight)


def test_runs_that_are_all_of_a_few_samples_do_not_say_how_noisy_they_are():
    assert not tells_noise(np.ones((3, 6)))
    assert tells_noise(np.ones((3, 7)))
