"""What tests of each kind tell, against closed forms of straight lines."""

import numpy as np
import pytest

from discover.plain_json import plain
from discover.statistics import Sized, Told, told_by_tests

N, NOISE = 400, 0.1
AT = np.linspace(-1.0, 1.0, N)


def told(columns, kinds, numbers, shared=None):
    rng = np.random.default_rng(0)
    residual = NOISE * rng.standard_normal(len(columns))
    places = np.split(np.arange(len(columns)), len(kinds))
    return told_by_tests(columns, residual, places, kinds, numbers, shared)


def line():
    """Return constants of a level and a slope: the first kind sees the level alone."""
    flat = np.stack([np.ones(N), np.zeros(N)], axis=1)
    tilted = np.stack([np.ones(N), AT], axis=1)
    return np.concatenate([flat, tilted])


def test_half_widths_are_those_of_a_straight_line():
    level, slope = told(
        line(), ["flat", "tilted"], [Sized("level", np.eye(2)[:1]), Sized("slope", np.eye(2)[1:])]
    )
    one = 1.96 * NOISE / np.sqrt(N)
    # the noise of 400 samples is known to 4 %, and correlation is estimated too
    assert level.alone["flat"] == pytest.approx(one, rel=0.2)
    assert level.together == pytest.approx(one / np.sqrt(2.0), rel=0.2)
    assert slope.alone["tilted"] == pytest.approx(one / np.sqrt(np.mean(AT**2)), rel=0.2)
    assert slope.together == pytest.approx(slope.alone["tilted"], rel=0.2)


def test_what_a_kind_does_not_see_it_does_not_determine():
    (slope,) = told(line(), ["flat", "tilted"], [Sized("slope", np.eye(2)[1:])])
    assert np.isinf(slope.alone["flat"])
    assert np.isinf(slope.without["tilted"])
    assert np.isfinite(slope.alone["tilted"])


def test_a_prediction_may_be_determined_where_its_constants_are_not():
    # the same sum of both everywhere: each by itself is open
    same = np.ones((2 * N, 2))
    total, one = told(
        same, ["a", "b"], [Sized("sum", np.array([[1.0, 1.0]])), Sized("one", np.eye(2)[:1])]
    )
    assert total.alone["a"] == pytest.approx(1.96 * NOISE / np.sqrt(N), rel=0.2)
    assert np.isinf(one.together)


def test_one_kind_of_test_is_compared_with_nothing():
    assert told(line(), ["flat", "flat"], [Sized("slope", np.eye(2)[1:])]) == ()


def test_an_error_that_all_share_stays_however_many_samples_there_are():
    shared = np.full((2 * N, 1), 0.05)
    (level,) = told(line(), ["flat", "tilted"], [Sized("level", np.eye(2)[:1])], shared)
    assert level.together > 1.9 * 0.05


def test_what_is_written_is_read():
    found = told(line(), ["flat", "tilted"], [Sized("slope", np.eye(2)[1:])])
    assert tuple(Told.from_json(plain(one)) for one in found) == found
