"""A law with a name heads the answer where runs left out in turn do not exclude it."""

import numpy as np
import pytest

from discover.inference.engine.left_out import weights_of
from discover.loop.preference import first_of


def first(misses, named, runs=6):
    """Return which of some laws comes first, each missing every run by as much."""
    return first_of(weights_of(np.tile(np.array(misses)[:, None], runs)), named)


def test_a_law_with_a_name_comes_first_where_it_misses_runs_by_about_as_much():
    assert first([0.054, 0.060], [False, True]) == 1
    assert first([0.054, 0.200, 0.060], [False, True, True]) == 2  # the better of two with a name


def test_it_does_not_where_it_misses_them_by_more_than_so_few_runs_scatter():
    assert first([0.054, 0.200], [False, True]) == 0
    assert first([0.054, 0.060], [False, False]) == 0
    assert first([0.0, 0.060], [False, True]) == 0


# six runs allow a ratio of (1/0.05)^(1/6) = 1.65, thirty 1.11: the density of R misses of one
# deviation goes as the sum of their squares to the power -R/2
@pytest.mark.parametrize(("runs", "ratio"), [(6, 20.0 ** (1 / 6)), (30, 20.0 ** (1 / 30))])
def test_how_much_more_it_may_miss_falls_with_the_number_of_runs(runs, ratio):
    assert first([0.05, 0.05 * (ratio - 0.01)], [False, True], runs) == 1
    assert first([0.05, 0.05 * (ratio + 0.01)], [False, True], runs) == 0
