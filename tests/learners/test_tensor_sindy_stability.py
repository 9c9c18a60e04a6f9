"""Stability selection, and several rules on one path."""

import numpy as np
import pytest
from shared_flows import LIBRARY, small_dataset

from discover.learners.tensor_sindy import TensorSINDy
from discover.learners.tensor_sindy.refit import Fit
from discover.learners.tensor_sindy.selectors import choose_by_stability, compare_selectors
from discover.learners.tensor_sindy.stability import STABLE, Stability, selection_stability

SLIP = ("johnson_segalman", {"xi": 0.4})


@pytest.fixture(scope="module")
def fitted():
    model = TensorSINDy(LIBRARY, max_terms=3, n_folds=0, n_stability=0)
    return model.fit(small_dataset(*SLIP, noise=0.02))


def stability(model, seed=0, n_pairs=5):
    return selection_stability(
        model.search_.problem,
        model.path_[1],
        "stlsq",
        3,
        1e-5,
        [fit.support for fit in model.path_],
        n_pairs,
        seed,
    )


@pytest.mark.slow
def test_the_true_term_is_stable_and_its_twins_take_its_place(fitted):
    found = stability(fitted)
    slip = LIBRARY.names.index("sigma.gammadot+gammadot.sigma")
    twin = LIBRARY.names.index("tr(sigma)*gammadot")
    assert found.interchangeable[slip] >= STABLE
    # the twin's signature is the slip's: together they are as stable as either
    assert found.interchangeable[twin] == found.interchangeable[slip]


def test_terms_that_made_nothing_are_not_stable(fitted):
    found = stability(fitted)
    twins = {"sigma.gammadot+gammadot.sigma", "tr(sigma)*gammadot", "tr(sigma.gammadot)*I"}
    others = [i for i, name in enumerate(LIBRARY.names) if name not in twins]
    assert np.max(found.interchangeable[others]) < STABLE


def test_the_same_seed_gives_the_same_halves(fitted):
    first, again = stability(fitted, n_pairs=2), stability(fitted, n_pairs=2)
    np.testing.assert_array_equal(first.frequency, again.frequency)


def path_of(*supports):
    nothing = np.zeros(0)
    return [Fit(s, np.ones(len(s)), nothing, 0.1, nothing) for s in supports]


def test_stability_chooses_the_largest_member_of_stable_terms():
    frequency = np.array([0.9, 0.7, 0.1])
    path = path_of((), (0,), (0, 1), (0, 1, 2))
    assert choose_by_stability(path, Stability(frequency, frequency)) == 2
    assert choose_by_stability(path, Stability(0 * frequency, 0 * frequency)) == 0


def test_disagreement_of_rules_is_said():
    path = path_of((), (0,), (0, 1))
    frequency = np.array([1.0, 0.2])
    table = compare_selectors(
        ["a", "b"],
        path,
        np.array([3.0, 2.0, 1.0]),
        None,
        Stability(frequency, frequency),
        (0,),
        1e-5,
    )
    assert table["chosen"] == {"bic": ["a", "b"], "stability": ["a"], "pysindy": ["a"]}
    assert not table["agree"]
    agreeing = compare_selectors(
        ["a", "b"], path, np.array([3.0, 1.0, 2.0]), None, None, (0,), 1e-5
    )
    assert agreeing["agree"]
