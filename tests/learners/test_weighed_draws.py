"""Draws of parameters against targets whose quantiles are known in closed form."""

import numpy as np
import pytest
from scipy.stats import lognorm, truncnorm

from discover.learners.tensor_sindy.weighed_draws import exchangeable, weighed_draws

CORRELATED = np.array([[0.04, 0.0285], [0.0285, 0.0225]])


def test_where_the_law_is_linear_its_covariance_serves():
    centre, precision = np.array([1.0, -0.5]), np.linalg.inv(CORRELATED)

    def deviance(laws):
        return np.einsum("ni,ij,nj->n", laws - centre, precision, laws - centre)

    found = weighed_draws(centre, CORRELATED, deviance)
    assert found.method == "linear"
    assert found.linear_share == pytest.approx(1.0)  # every weight is one
    assert not found.reason
    assert found.values.size == 0


def test_a_bent_likelihood_is_weighed():
    """exp(−(ln θ)²/2s²) dθ is log-normal, its logarithm centred at s²."""
    width = 0.4
    found = weighed_draws(
        np.ones(1),
        np.array([[width**2]]),
        lambda laws: np.where(
            laws[:, 0] > 0, (np.log(np.maximum(laws[:, 0], 1e-300)) / width) ** 2, np.inf
        ),
    )
    assert found.method == "weighed"
    low, high = found.intervals[0]
    exact = lognorm(width, scale=np.exp(width**2)).ppf([0.025, 0.975])
    # 270 independent draws: seven beyond each end, in tails that fall off slowly
    np.testing.assert_allclose([low, high], exact, rtol=0.25)
    # the negative control: the linearised interval ends far below either
    assert 1.0 - 1.96 * width < 0.5 * low
    assert 1.0 + 1.96 * width < 0.8 * high


def test_laws_that_run_away_are_no_part_of_the_interval():
    found = weighed_draws(
        np.zeros(1), np.eye(1), lambda laws: np.where(laws[:, 0] < 0.2, laws[:, 0] ** 2, np.inf)
    )
    assert found.method == "weighed"
    low, high = found.intervals[0]
    assert high <= 0.2
    assert low == pytest.approx(truncnorm(-np.inf, 0.2).ppf(0.025), rel=0.25)


def test_constants_of_which_only_the_product_is_known_have_no_interval():
    centre = np.ones(2)
    soft, stiff = np.array([1.0, -1.0]) / np.sqrt(2), np.array([1.0, 1.0]) / np.sqrt(2)
    covariance = 100.0 * np.outer(soft, soft) + 0.01**2 * np.outer(stiff, stiff)

    def deviance(laws):
        return ((laws[:, 0] * laws[:, 1] - 1.0) / 0.02) ** 2 + (laws @ soft / 10.0) ** 2

    found = weighed_draws(centre, covariance, deviance)
    assert found.method == "none"
    assert "no interval and no band" in found.reason
    assert found.to_json()["values"] == []


@pytest.mark.parametrize("variance", [np.nan, np.inf, 0.0, -1.0])
def test_a_covariance_that_is_none_gives_no_draws(variance):
    found = weighed_draws(np.ones(1), np.array([[variance]]), lambda laws: np.zeros(len(laws)))
    assert found.method == "none"


def test_columns_that_are_one_are_exchangeable_and_others_are_not():
    time = np.linspace(0.0, 1.0, 50)
    one, other = np.sin(time), np.cos(time)
    assert exchangeable(np.eye(2), np.column_stack([one, 3.0 * one]))
    assert not exchangeable(np.eye(2), np.column_stack([one, other]))
    # nearly the same is not the same: their interval is wide and right
    assert not exchangeable(np.eye(2), np.column_stack([one, one + 1e-3 * other]))
