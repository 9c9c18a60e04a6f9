"""A residual that looks like noise from run to run, or at the same place in all: lack of fit."""

import numpy as np
import pytest

from discover.statistics import lack_of_fit
from discover.statistics.noise import whiteness
from discover.statistics.noise.whiteness import noise_probability, same_place_probability
from discover.statistics.residual import Expectation, noise_floor

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


@pytest.mark.parametrize("share", [0.02, 0.1])
def test_outliers_are_counted_and_do_not_vote(share):
    generator = np.random.default_rng(3)
    noise = 0.1 * generator.standard_normal(SAMPLES)
    off = generator.random(SAMPLES) < share
    spikes = 3.0 * off * generator.choice([-1.0, 1.0], SAMPLES)
    found = lack_of_fit([noise + spikes], [WAVE - noise - spikes])
    assert found.outliers > 0.7 * np.count_nonzero(off)
    assert found.noise < 0.35 * np.sqrt(np.mean((noise + spikes) ** 2)) / 7.07
    clean = lack_of_fit([noise], [WAVE - noise])
    assert (clean.outliers, clean.verdict) == (0, "explained")
    assert clean.noise == pytest.approx(0.1 / 7.07, rel=0.2)


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


NOISE, LENGTH = 0.01, 61


def noise(seed: int) -> np.ndarray:
    return NOISE * np.random.default_rng(seed).standard_normal((5, LENGTH))


def newtonian_missed_at_the_start(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A viscous fluid, at once at its stress, and a Maxwell fluid of short memory from zero."""
    rates = np.array([[0.1], [0.3], [1.0], [3.0], [10.0]])
    measured = 5.0 * rates * (1.0 + noise(seed))
    predicted = 5.0 * rates * (1.0 - np.exp(-np.linspace(0.0, 1e4, LENGTH)))
    return predicted - measured, measured


@pytest.mark.parametrize("runs", [1, 5])
def test_a_start_that_every_run_misses_is_no_noise(runs):
    residual, measured = newtonian_missed_at_the_start()
    left = lack_of_fit([*residual[:runs]], [*measured[:runs]])
    assert left.verdict == "unexplained"
    assert left.outliers == 0
    # of 61 samples in one run the size is known to 10 %, to half of that in five
    assert left.noise == pytest.approx(NOISE, rel=0.25)


def test_without_the_start_noise_is_left():
    residual, measured = newtonian_missed_at_the_start()
    assert lack_of_fit([*residual[:, 1:]], [*measured[:, 1:]]).verdict == "explained"


def test_a_loud_start_that_differs_from_run_to_run_is_noise():
    # the level of the test is 0.01; more than 3 of 40 has a probability below 1e-3
    taken = 0
    for seed in range(40):
        loud = noise(seed)
        loud[:, :3] *= 15.0
        taken += same_place_probability([*loud]) <= 0.01
    assert taken <= 3


@pytest.mark.parametrize(
    ("places", "verdict", "outliers"),
    [((7, 19, 30, 41, 52), "explained", 5), ((30,) * 5, "unexplained", 0)],
)
def test_knocks_at_different_places_are_outliers_and_at_one_place_structure(
    places, verdict, outliers
):
    left = noise(1)
    left[np.arange(5), places] += 0.5
    told = lack_of_fit([*left], [*(1.0 - left)])
    assert (told.verdict, told.outliers) == (verdict, outliers)


def test_few_samples_do_not_hide_a_misfit_in_the_noise():
    # start-ups of Maxwell fluids against one of other times, eight samples each
    times = np.linspace(0.0, 5.0, 8)
    record = 1.0 - np.exp(-times)
    size = np.sqrt(np.mean(record**2))
    missed = [(np.exp(-times) - np.exp(-times / other)) / size for other in (0.5, 1.5, 2.0, 3.0)]
    floors = []
    for seed in range(20):
        noise = NOISE * np.random.default_rng(seed).standard_normal((4, 8))
        rows = missed + noise
        probability = noise_probability(rows)
        floors.append(noise_floor([*rows], probability))
        assert not Expectation().explains([*rows], probability, floors[-1])
    # 16 differences tell it to 40 %, the mean of 20 draws to 9 %; the bends of the misfit add some
    assert np.mean(floors) < 1.5 * NOISE
