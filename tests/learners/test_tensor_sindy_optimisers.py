import numpy as np
import pysindy
import pytest

from discover.errors import InputError
from discover.learners.tensor_sindy.optimisers import OPTIMISERS, check_optimiser, solve_sparse

TRUTH = {2: 3.0, 7: -0.01}


def planted(noise=0.0):
    generator = np.random.default_rng(1)
    design = generator.normal(size=(300, 12)) * np.geomspace(1e-3, 1e3, 12)
    target = sum(c * design[:, i] for i, c in TRUTH.items())
    return design, target + noise * np.std(target) * generator.normal(size=300)


@pytest.mark.parametrize("name", OPTIMISERS)
def test_planted_terms_are_proposed_whatever_their_units(name):
    design, target = planted(noise=0.01)
    supports = solve_sparse(name, design, target, max_terms=4)
    assert tuple(TRUTH) in supports
    coefficients = supports[tuple(TRUTH)][list(TRUTH)]
    # noise of 1 % over 300 rows, and the bias of what the optimiser itself shrinks
    np.testing.assert_allclose(coefficients, list(TRUTH.values()), rtol=0.15)


@pytest.mark.parametrize("name", OPTIMISERS)
def test_a_zero_column_is_never_proposed_and_a_repeated_one_does_no_harm(name):
    design, target = planted()
    design = np.column_stack([design, np.zeros(300), design[:, 2]])
    solutions = solve_sparse(name, design, target, 4)
    assert solutions
    assert all(12 not in support for support in solutions)


def test_no_signal_gives_no_proposal():
    assert solve_sparse("stlsq", np.ones((5, 2)), np.zeros(5), 2) == {}
    assert solve_sparse("stlsq", np.zeros((5, 2)), np.ones(5), 2) == {}


def test_a_pysindy_optimiser_is_used_as_set_and_left_as_it_was():
    design, target = planted()
    optimiser = pysindy.STLSQ(threshold=0.01, alpha=1e-6)
    before = dict(optimiser.get_params())
    solutions = solve_sparse(optimiser, design, target, 4)
    assert list(solutions) == [tuple(TRUTH)]
    assert optimiser.get_params() == before
    assert not hasattr(optimiser, "coef_")


@pytest.mark.parametrize("bad", ["lasso?", 3])
def test_an_unknown_optimiser_is_refused_with_the_known_ones_listed(bad):
    with pytest.raises(InputError, match="stlsq, sr3, ssr, frols"):
        check_optimiser(bad)
