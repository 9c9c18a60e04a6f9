"""A fit knows its derivatives when they are asked for, and the best of fits has them."""

import warnings

import numpy as np
import pytest

from discover.inference.least_squares import Fit, best_of


def fit_of(residual, slope, asked):
    """Return a fit of one parameter, which notes its residual whenever derivatives are computed."""

    def derivatives():
        asked.append(residual)
        return np.full((1, 1, 2), slope)

    return Fit(np.zeros(1), (0,), np.full((1, 2), residual), derivatives)


def test_derivatives_are_computed_once_and_not_before_they_are_asked_for():
    asked = []
    fit = fit_of(2.0, 3.0, asked)
    assert fit.cost == pytest.approx(8.0)
    assert asked == []
    for _ in range(2):
        np.testing.assert_array_equal(fit.jacobian, 3.0)
    assert asked == [2.0]


def test_the_best_of_fits_is_the_usable_one_of_least_cost_and_no_other_is_asked():
    asked = []
    fits = [fit_of(residual, 1.0, asked) for residual in (3.0, np.nan, 2.0, 1e200)]
    edge = fit_of(1.0, np.inf, asked)  # no derivatives there: of no use
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert best_of([*fits, edge]) is fits[2]
    assert asked == [1.0, 2.0]


def test_of_fits_that_all_ran_away_none_is_best():
    assert best_of([fit_of(np.inf, 1.0, []), fit_of(np.nan, 1.0, [])]) is None
