"""What repeats at one place of several runs is no noise, however few samples it is."""

import numpy as np
import pytest

from discover.statistics import lack_of_fit
from discover.statistics.noise.whiteness import noise_probability, same_place_probability
from discover.statistics.residual import Expectation, noise_floor

NOISE, SAMPLES = 0.01, 61


def noise(seed: int) -> np.ndarray:
    return NOISE * np.random.default_rng(seed).standard_normal((5, SAMPLES))


def newtonian_missed_at_the_start(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A viscous fluid, at once at its stress, and a Maxwell fluid of short memory from zero."""
    rates = np.array([[0.1], [0.3], [1.0], [3.0], [10.0]])
    measured = 5.0 * rates * (1.0 + noise(seed))
    predicted = 5.0 * rates * (1.0 - np.exp(-np.linspace(0.0, 1e4, SAMPLES)))
    return predicted - measured, measured


@pytest.mark.parametrize("runs", [1, 5])
def test_a_start_that_every_run_misses_is_no_noise(runs):
    residual, measured = newtonian_missed_at_the_start()
    left = lack_of_fit([*residual[:runs]], [*measured[:runs]])
    assert left.verdict == "unexplained"
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


def test_knocks_at_one_place_of_several_runs_are_structure():
    left = noise(1)
    left[:, 30] += 0.5
    assert lack_of_fit([*left], [*(1.0 - left)]).verdict == "unexplained"


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
