"""How much each run weighs: by its own noise, where a law misses no run by more than noise."""

import numpy as np
from discover.statistics.noise_weights import weights_by_noise

TIMES = np.linspace(0.0, 1.0, 80)


def noise(size: float, samples: int = 80, seed: int = 0) -> np.ndarray:
    return size * np.random.default_rng(seed).standard_normal(samples)


def test_runs_weigh_in_inverse_proportion_to_their_noise():
    weights = weights_by_noise([noise(0.05), noise(0.005, seed=1)], ["a", "a"], random=True)
    assert weights is not None
    loud, quiet = weights
    # a median of 80 samples knows a noise to a seventh
    assert 7.0 < quiet / loud < 13.0


def test_weights_leave_the_mean_noise_what_it_is():
    left = [noise(0.05), noise(0.005, seed=1)]
    weights = weights_by_noise(left, ["a", "b"], random=True)
    assert weights is not None
    sizes = np.array([1.4826 * np.median(np.abs(row)) for row in left])
    assert np.isclose(np.mean(sizes * weights), np.mean(sizes))


def test_runs_about_as_noisy_as_one_another_weigh_the_same():
    left = [noise(size, 40, seed) for seed, size in enumerate([0.05, 0.03, 0.04, 0.05, 0.03])]
    for random in (True, False):
        assert weights_by_noise(left, list("abcde"), random) is None


def test_a_quiet_run_missed_by_less_than_the_loud_noise_is_weighed_by_what_changes_in_it():
    missed = noise(0.002, seed=1) + 0.01 * np.sin(6.0 * TIMES)
    weights = weights_by_noise([noise(0.05), missed], ["a", "b"], random=False)
    assert weights is not None
    assert weights[1] > 5.0 * weights[0]


def test_a_law_that_misses_a_run_by_more_than_any_noise_weighs_all_alike():
    missed = noise(0.002, seed=1) + 0.2 * np.sin(6.0 * TIMES)
    assert weights_by_noise([noise(0.05), missed], ["a", "b"], random=False) is None


def test_short_runs_take_the_noise_of_their_kind():
    short = [noise(0.005, 8, seed) for seed in range(1, 6)]
    weights = weights_by_noise([noise(0.05), *short], ["a", *"bbbbb"], random=True)
    assert weights is not None
    assert len(set(weights[1:])) == 1
    assert weights[1] > 5.0 * weights[0]


def test_a_record_without_noise_weighs_a_hundred_times_the_loudest_at_most():
    weights = weights_by_noise([noise(0.05), noise(1e-9, seed=1)], ["a", "b"], random=True)
    assert weights is not None
    assert np.isclose(weights[1] / weights[0], 100.0)
