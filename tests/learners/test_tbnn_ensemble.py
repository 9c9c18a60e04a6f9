"""Networks trained side by side."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from discover.laws import Fluid
from discover.learners.tbnn_ude import TBNNUDE, DefaultRecipe
from discover.learners.tbnn_ude.ensemble import member_misfits, stack_members, train_members
from discover.learners.tbnn_ude.least_squares import Stopping
from discover.learners.tbnn_ude.prior import sample_states
from discover.learners.tbnn_ude.problem import make_problem
from discover.learners.tbnn_ude.recipe_default import initial_law, invariant_sizes
from discover.learners.tbnn_ude.spread import coefficient_spread, member_predictions
from discover.protocols import oscillatory_shear, start_up
from discover.simulate import synthetic_dataset

FLOWS = {f"laos_{wi:g}_0.5": oscillatory_shear(wi, 0.5) for wi in (1.0, 2.0)}
TEST, TIMES = start_up(2.0), np.linspace(0.0, 5.0, 26)
RECIPE = DefaultRecipe(width=6, steps=8, polish_steps=40, max_tensors=1)


@pytest.fixture(scope="module")
def problem():
    data = synthetic_dataset("ptt_linear", {"epsilon": 0.4}, FLOWS, duration=8.0, n_samples=41)
    return make_problem(data.runs, np.ones(1), np.ones(1))


@pytest.fixture(scope="module")
def found(problem):
    """A law whose coefficient on σ may vary, as a search for tensors would leave it."""
    law = initial_law(jax.random.key(0), RECIPE.width, True, jnp.ones(8))
    scale = invariant_sizes(sample_states(law, problem))
    law = initial_law(jax.random.key(0), RECIPE.width, True, scale)
    return eqx.tree_at(lambda tree: tree.network_mask, law, jnp.zeros(8).at[1].set(1.0))


@pytest.fixture(scope="module")
def members(problem, found):
    return train_members(problem, found, jax.random.split(jax.random.key(1), 3), RECIPE)


def test_members_share_the_tensors_and_differ_in_their_weights(found, members):
    for member in members:
        np.testing.assert_array_equal(member.network_mask, found.network_mask)
    layers = [np.asarray(member.network.layers[0].weight) for member in members]
    assert not np.allclose(layers[0], layers[1])


def test_a_member_side_by_side_is_the_member_alone(problem, found, members):
    alone = train_members(problem, found, jax.random.split(jax.random.key(1), 3)[1:2], RECIPE)
    together, single = (member_misfits(stack_members(m), problem) for m in (members, alone))
    # a batched matrix product rounds otherwise; twenty steps of a descent amplify that
    assert together[1] == pytest.approx(single[0], rel=1e-3)


def test_early_steps_side_by_side_are_those_alone_to_rounding(problem, found):
    few = replace(RECIPE, steps=2, polish_steps=2)
    keys = jax.random.split(jax.random.key(1), 3)
    together = train_members(problem, found, keys, few)[1]
    (alone,) = train_members(problem, found, keys[1:2], few)
    cloud = sample_states(found, problem)
    # rounding of batched products, 1e-16, by the condition of damped normal equations
    np.testing.assert_allclose(cloud.coefficients(together), cloud.coefficients(alone), atol=1e-8)


def test_every_member_learns(problem, found, members):
    untrained = train_members(
        problem,
        found,
        jax.random.split(jax.random.key(1), 3),
        DefaultRecipe(width=6, steps=1, polish_steps=1, max_tensors=1),
    )
    before, after = (member_misfits(stack_members(m), problem) for m in (untrained, members))
    assert np.all(after < 0.5 * before)


@pytest.fixture(scope="module")
def constant():
    data = synthetic_dataset("giesekus", {"alpha": 0.3}, FLOWS, duration=8.0, n_samples=41)
    return TBNNUDE(recipe=RECIPE, n_members=3).fit(data.runs)


def test_where_constants_suffice_members_do_not_differ_and_it_is_said(constant):
    assert len(constant.members_) == len(constant.ensemble_fluids_) == 3
    assert constant.result_.details["ensemble"].startswith("constants suffice")
    assert all(member is constant.law_ for member in constant.members_)
    spread = constant.result_.details["coefficient_spread_of_members"]
    assert max(spread.values()) < 1e-15  # rounding of a mean of three equal numbers
    predicted = constant.predict_members(TEST, TIMES)
    for quantity in ("sigma12", "N1", "N2"):
        low, high = predicted.band(quantity)
        np.testing.assert_array_equal(low, high)


def test_members_of_other_weights_spread_where_shear_stress_does_not_decide(problem, members):
    predicted = member_predictions([Fluid.dimensionless(m) for m in members], TEST, TIMES)
    low, high = predicted.band("N1")
    assert np.all(low <= high)
    assert np.max(high - low) > 1e-8 * np.max(high)  # trained apart, not copies of one another
    # all act on the stress alone, and that law has no second normal stress difference
    np.testing.assert_allclose(predicted.band("N2"), 0.0, atol=1e-12)
    spread = coefficient_spread(members, sample_states(members[0], problem))
    acting = [name for name, value in spread.items() if value > 0.0]
    assert acting == ["sigma"]


def test_a_member_that_runs_away_is_counted_and_left_out_of_the_band(members):
    lost = eqx.tree_at(lambda law: law.constants, members[0], jnp.zeros(8).at[3].set(-8.0))
    fluids = [Fluid.dimensionless(law) for law in (members[0], lost)]
    predicted = member_predictions(fluids, TEST, TIMES)
    assert predicted.ran_away == 1
    np.testing.assert_array_equal(predicted.band("sigma12")[0], predicted.sigma12[0])
    none = member_predictions(fluids[1:], TEST, TIMES)
    assert np.all(np.isnan(none.band("N1")))


def test_a_descent_ends_at_its_target_or_when_steps_no_longer_pay():
    assert Stopping(1e-3).done(1e-4)
    slow = Stopping(0.0)
    assert [slow.done(1.0 - 1e-5 * i) for i in range(6)] == [False] * 4 + [True, True]
    # rejected steps repeat the misfit: patience, within bounds
    stuck = Stopping(0.0)
    assert [stuck.done(1.0) for _ in range(9)] == [False] * 8 + [True]
