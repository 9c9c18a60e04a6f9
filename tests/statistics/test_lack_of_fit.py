"""What a model leaves, judged: noise, something more, or of records that hold nothing."""

import numpy as np
import pytest

from discover.statistics import lack_of_fit
from discover.statistics.noise import whiteness
from discover.statistics.residual import Expectation

SAMPLES = 300
TIMES = np.linspace(0.1, 60.0, SAMPLES)
WAVE = 10.0 * np.sin(TIMES)


def correlated(rho, seed, n=SAMPLES):
    generator = np.random.default_rng(seed)
    drawn = generator.standard_normal(n)
    for i in range(1, n):
        drawn[i] = rho * drawn[i - 1] + np.sqrt(1.0 - rho**2) * drawn[i]
    return drawn


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_a_residual_that_repeats_every_cycle_is_no_noise_though_the_start_is_louder(noise):
    # third harmonic of a nonlinear fluid, and the transient of a start that was none
    left = 0.5 * np.sin(3.0 * TIMES) - 8.0 * np.exp(-3.0 * TIMES) + noise * correlated(0.0, 0)
    found = lack_of_fit([left], [WAVE])
    assert found.verdict == "unexplained"
    assert found.noise < 0.02


@pytest.mark.parametrize(("correlation", "doubted"), [(0.0, False), (0.85, True)])
def test_noise_that_may_as_well_be_a_smooth_misfit_is_told_so(correlation, doubted):
    left = lack_of_fit([0.3 * correlated(correlation, 3)], [WAVE])
    assert left.verdict == "explained"
    assert ("a misfit if not" in left.reason) == doubted
    given = lack_of_fit([0.3 * correlated(correlation, 3)], [WAVE], Expectation(noise=0.05))
    assert "a misfit if not" not in given.reason


def test_spikes_once_a_cycle_are_found_by_the_cycle():
    generator = np.random.default_rng(0)
    once = np.zeros(SAMPLES)
    once[::33] = 3.0
    turn = np.arange(SAMPLES) * 2.0 * np.pi / 33.0
    record = 10.0 * np.sin(turn)
    assert whiteness.cycle(record) == pytest.approx(33.0, abs=0.5)
    here = generator.standard_normal(SAMPLES)
    assert whiteness.noise_probability((here + once)[None]) > 1e-3
    assert whiteness.noise_probability((here + once)[None], record[None]) < 1e-3
    assert whiteness.noise_probability(here[None], record[None]) > 1e-3


PROPORTIONAL = np.abs(np.sin(TIMES)) + 0.1
LOUD_START = 1.0 + 15.0 * np.exp(-TIMES)
LOUDER_LATER = 1.0 + 4.0 * (TIMES > 30.0)


@pytest.mark.parametrize(
    ("correlation", "size"),
    [
        *((rho, np.ones(SAMPLES)) for rho in (0.0, 0.6, 0.9)),
        *((rho, PROPORTIONAL) for rho in (0.0, 0.6)),
        *((rho, LOUDER_LATER) for rho in (0.0, 0.9)),
        *((rho, LOUD_START) for rho in (0.0, 0.6, 0.9)),
    ],
)
def test_noise_of_any_size_is_rarely_taken_for_structure(correlation, size):
    taken = 0
    for seed in range(30):
        rows = np.array([size * correlated(correlation, 100 * seed + i) for i in range(3)])
        taken += whiteness.noise_probability(rows, np.tile(WAVE, (3, 1))) <= 1e-3
    # significance 0.001: more than 2 of 30 has a probability below 1e-5
    assert taken <= 2


def test_what_looks_like_correlated_noise_is_as_large_as_all_that_is_left():
    residual, record = 0.3 * correlated(0.85, 0), WAVE
    found = lack_of_fit([residual], [record])
    assert found.verdict == "explained"
    assert found.noise == pytest.approx(np.sqrt(np.mean(residual**2)) / 7.07, rel=0.1)


def test_a_model_that_misses_all_of_a_record_explains_nothing():
    found = lack_of_fit([-correlated(0.0, 0)], [correlated(0.0, 0)], Expectation())
    assert found.verdict == "no_signal"


def test_separate_points_of_noise_alone_agree_as_seldom_as_the_level_says():
    generator = np.random.default_rng(2)
    # louder where the stress is large, as of a flow curve
    rows = [generator.standard_normal(n) * np.geomspace(1.0, 3.0, n) for n in [7, 12, 25] * 100]
    low = sum(whiteness.separate_probability([row]) <= 0.05 for row in rows)
    # 5 % of 300, within three standard deviations of a binomial count
    assert low <= 15 + 3 * np.sqrt(300 * 0.05 * 0.95)


def test_a_smooth_misfit_of_separate_points_is_no_noise_though_few_are_tested_otherwise():
    smooth = np.cos(np.linspace(0.0, 2.0 * np.pi, 20))
    left = 3.0 * smooth + np.random.default_rng(0).standard_normal(20)
    assert whiteness.noise_probability(left[None]) is None
    assert whiteness.separate_probability([left]) < 0.01


@pytest.mark.parametrize("error", [0.0, 0.02])
def test_a_pattern_that_the_sweep_excuses_is_explained_and_yet_no_noise(error):
    noise = 0.003 * 10.0 * correlated(0.0, 1)
    smooth = 0.15 * np.sin(3.0 * TIMES)
    excused = lack_of_fit([smooth + noise], [WAVE], Expectation(linear_error=error))
    assert excused.verdict == ("explained" if error else "unexplained")
    assert excused.probability is not None
    assert excused.probability <= whiteness.SIGNIFICANCE
    assert ("a pattern no larger than the linear data's error" in excused.reason) == bool(error)
    plain = lack_of_fit([noise], [WAVE], Expectation(linear_error=error))
    assert plain.verdict == "explained"
    assert plain.probability > whiteness.SIGNIFICANCE
