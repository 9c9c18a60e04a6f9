"""Networks trained side by side."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from discover.learners.tbnn_ude import TBNNUDE, DefaultRecipe
from discover.learners.tbnn_ude.ensemble import member_misfits, stack_members, train_members
from discover.learners.tbnn_ude.least_squares import Stopping
from discover.learners.tbnn_ude.prior import sample_states
from discover.learners.tbnn_ude.problem import make_problem
from discover.learners.tbnn_ude.recipe_default import initial_law, invariant_sizes
from discover.protocols import oscillatory_shear
from discover.simulate import synthetic_dataset

FLOWS = {f"laos_{wi:g}_0.5": oscillatory_shear(wi, 0.5) for wi in (1.0, 2.0)}
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


def test_every_member_learns(problem, found, members):
    untrained = train_members(
        problem,
        found,
        jax.random.split(jax.random.key(1), 3),
        DefaultRecipe(width=6, steps=1, polish_steps=1, max_tensors=1),
    )
    before, after = (member_misfits(stack_members(m), problem) for m in (untrained, members))
    assert np.all(after < 0.5 * before)


def test_where_constants_suffice_members_do_not_differ_and_it_is_said():
    data = synthetic_dataset("giesekus", {"alpha": 0.3}, FLOWS, duration=8.0, n_samples=41)
    model = TBNNUDE(recipe=RECIPE, n_members=3).fit(data.runs)
    assert len(model.members_) == 3
    assert model.result_.details["ensemble"].startswith("constants suffice")
    assert all(member is model.law_ for member in model.members_)


def test_a_descent_ends_at_its_target_or_when_steps_no_longer_pay():
    assert Stopping(1e-3).done(1e-4)
    slow = Stopping(0.0)
    assert [slow.done(1.0 - 1e-5 * i) for i in range(6)] == [False] * 4 + [True, True]
    # rejected steps repeat the misfit: patience, within bounds
    stuck = Stopping(0.0)
    assert [stuck.done(1.0) for _ in range(9)] == [False] * 8 + [True]
