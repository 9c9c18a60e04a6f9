"""A descent step by step ends where SciPy's does, and no trial that runs away leads it astray."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from discover.learners.tbnn_ude.least_squares import Linearised, Steps

START = np.array([-1.2, 1.0])


def valley(x):
    """Return residuals of Rosenbrock's valley and their derivatives, not finite where x₁ > 2."""
    if not x[1] < 2.0:
        return Linearised(np.full(2, np.nan), np.full((2, 2), np.inf))
    rows = np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]])
    return Linearised(rows, np.array([[-20.0 * x[0], 10.0], [-1.0, 0.0]]))


def descended(start, steps):
    descent = Steps(start)
    norms = []
    for _ in range(steps):
        descent.take(valley(descent.trial))
        norms.append(descent.norm)
    return descent, norms


def test_it_ends_where_scipy_does():
    expected = least_squares(lambda x: valley(x).rows, START, method="lm").x
    descent, norms = descended(START, 60)
    # both to rounding: the residuals vanish
    np.testing.assert_allclose(descent.best, expected, atol=1e-6)
    assert np.all(np.diff(norms) <= 0.0)


def test_a_trial_that_runs_away_is_a_rejected_step():
    descent = Steps(START)
    descent.take(valley(descent.trial))
    first, norm = descent.trial, descent.norm
    descent.take(Linearised(np.array([np.inf, np.nan]), np.full((2, 2), np.nan)))
    assert np.array_equal(descent.best, START)
    assert descent.norm == norm
    # a shorter step is tried next
    assert 0.0 < np.linalg.norm(descent.trial - START) < np.linalg.norm(first - START)


@pytest.mark.filterwarnings("error")
def test_a_start_that_runs_away_is_told_by_its_norm():
    descent, norms = descended(np.array([0.0, 3.0]), 2)
    assert not np.any(np.isfinite(norms))
    assert np.array_equal(descent.best, [0.0, 3.0])


def test_residuals_alone_reject_a_trial_where_the_derivatives_would_be_of_no_use():
    expected, _ = descended(START, 60)
    descent, with_derivatives = Steps(START), 0
    for _ in range(60):
        if not descent.goes_up(valley(descent.trial).rows):
            descent.take(valley(descent.trial))
            with_derivatives += 1
    assert np.array_equal(descent.best, expected.best)
    assert with_derivatives < 60
