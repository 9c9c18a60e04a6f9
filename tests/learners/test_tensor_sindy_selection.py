import numpy as np

from discover.learners.tensor_sindy.search import (
    choose_by_held_out,
    choose_by_one_standard_error,
)


def test_of_equal_members_the_simplest_is_chosen():
    assert choose_by_held_out(np.full((3, 4), 0.02)) == 0


def test_held_out_prefers_the_simplest_that_cannot_be_told_from_the_best():
    generator = np.random.default_rng(0)
    errors = 0.02 * (1.0 + 0.01 * generator.standard_normal((4, 8)))
    errors[0] = 0.4
    assert choose_by_held_out(errors) == 1


def test_held_out_takes_the_larger_where_it_is_better_in_every_run():
    generator = np.random.default_rng(0)
    errors = 0.02 * (1.0 + 0.01 * generator.standard_normal((3, 8)))
    errors[0], errors[1] = 0.4, errors[1] * 1.2
    assert choose_by_held_out(errors) == 2


def test_misfits_below_the_floor_do_not_buy_a_term():
    assert choose_by_held_out(np.array([[1e-6] * 4, [1e-9] * 4])) == 0


def test_a_member_that_runs_away_is_not_chosen():
    errors = np.array([[0.4] * 4, [0.02] * 4, [0.01, np.inf, 0.01, np.nan]])
    assert choose_by_held_out(errors) == 1


def test_one_standard_error_takes_the_simplest_law_that_the_spread_over_runs_allows():
    # means 0.160, 0.0424, 0.0404 of the squares; the last one's standard error is 0.0029
    errors = np.array([[0.4] * 4, [0.2, 0.22, 0.19, 0.213], [0.2, 0.22, 0.18, 0.203]])
    assert choose_by_one_standard_error(errors) == 1
    # the same difference where the runs agree is more than an error
    exact = np.array([[0.4] * 4, [0.206] * 4, [0.201] * 4])
    assert choose_by_one_standard_error(exact) == 2


def test_one_standard_error_does_not_take_what_runs_away():
    errors = np.array([[0.4] * 4, [0.02, 0.021, 0.02, 0.02], [0.01, np.inf, 0.01, np.nan]])
    assert choose_by_one_standard_error(errors) == 1
