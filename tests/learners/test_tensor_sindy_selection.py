import numpy as np

from discover.learners.tensor_sindy.linear_model import additions, all_of_size, removals, swaps
from discover.learners.tensor_sindy.selection import (
    choose_by_bic,
    choose_by_held_out,
    choose_by_one_standard_error,
    extended_bic,
)
from discover.learners.tensor_sindy.validation import run_folds


def test_a_term_is_worth_more_misfit_in_a_larger_library():
    # the same gain from a second term: worth it among 3 candidates, not among 300
    def gain(library_size):
        one = extended_bic(0.0200, 1600, 1, 0, library_size)
        return one - extended_bic(0.0199, 1600, 2, 0, library_size)

    assert gain(3) > 0 > gain(300)


def test_an_inner_parameter_costs_as_much_as_a_coefficient():
    plain = extended_bic(0.02, 1000, 1, 0, 10)
    assert np.isclose(extended_bic(0.02, 1000, 1, 1, 10) - plain, np.log(1000))


def test_of_equal_members_the_simplest_is_chosen():
    assert choose_by_bic(np.array([5.0, -3.0, -3.0])) == 1
    assert choose_by_held_out(np.full((3, 4), 0.02), 1e-5) == 0


def test_held_out_prefers_the_simplest_that_cannot_be_told_from_the_best():
    generator = np.random.default_rng(0)
    errors = 0.02 * (1.0 + 0.01 * generator.standard_normal((4, 8)))
    errors[0] = 0.4
    assert choose_by_held_out(errors, 1e-5) == 1


def test_held_out_takes_the_larger_where_it_is_better_on_every_fold():
    generator = np.random.default_rng(0)
    errors = 0.02 * (1.0 + 0.01 * generator.standard_normal((3, 8)))
    errors[0], errors[1] = 0.4, errors[1] * 1.2
    assert choose_by_held_out(errors, 1e-5) == 2


def test_misfits_below_the_floor_do_not_buy_a_term():
    assert choose_by_held_out(np.array([[1e-6] * 4, [1e-9] * 4]), 1e-5) == 0


def test_a_member_that_runs_away_is_not_chosen():
    errors = np.array([[0.4] * 4, [0.02] * 4, [0.01, np.inf, 0.01, np.nan]])
    assert choose_by_held_out(errors, 1e-5) == 1


def test_one_standard_error_takes_the_simplest_law_that_the_spread_over_runs_allows():
    # means 0.160, 0.0424, 0.0404 of the squares; the last one's standard error is 0.0029
    errors = np.array([[0.4] * 4, [0.2, 0.22, 0.19, 0.213], [0.2, 0.22, 0.18, 0.203]])
    assert choose_by_one_standard_error(errors, 1e-5) == 1
    # the same difference where the runs agree is more than an error
    exact = np.array([[0.4] * 4, [0.206] * 4, [0.201] * 4])
    assert choose_by_one_standard_error(exact, 1e-5) == 2


def test_one_standard_error_does_not_take_what_runs_away():
    errors = np.array([[0.4] * 4, [0.02, 0.021, 0.02, 0.02], [0.01, np.inf, 0.01, np.nan]])
    assert choose_by_one_standard_error(errors, 1e-5) == 1


def test_folds_are_even_seeded_and_use_every_run():
    folds = run_folds(11, 4, 3)
    assert sorted(np.bincount(folds)) == [2, 3, 3, 3]
    assert np.array_equal(folds, run_folds(11, 4, 3))
    assert not np.array_equal(folds, run_folds(11, 4, 4))
    assert np.bincount(run_folds(3, 8, 0)).tolist() == [1, 1, 1]


def test_moves_reach_every_neighbour_once():
    assert additions((1,), 3) == [(0, 1), (1, 2)]
    assert removals((0, 2)) == [(2,), (0,)]
    assert set(swaps((0, 2), 4)) >= {(1, 2), (2, 3), (0, 1), (0, 3)}
    assert len(all_of_size(2, 5)) == 10
    assert all_of_size(6, 300) == []  # too many to score
