"""Members of an ensemble that reach the data by different ways."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from discover.laws import Fluid
from discover.learners.tbnn_ude import TBNNUDE, DefaultRecipe, ensemble
from discover.learners.tbnn_ude.least_squares import Stopping, sample_states
from discover.learners.tbnn_ude.problem import Trained, make_problem
from discover.learners.tbnn_ude.session import initial_law, invariant_sizes
from discover.protocols import oscillatory_shear, start_up
from discover.simulate import simulate, synthetic_dataset

FLOWS = {f"laos_{wi:g}_0.5": oscillatory_shear(wi, 0.5) for wi in (1.0, 2.0)}
TEST, TIMES = start_up(2.0), np.linspace(0.0, 5.0, 26)
RECIPE = DefaultRecipe(width=6, steps=8, polish_steps=20, max_tensors=1)
STRESS, RATE = 1, 2


def first_normal_stresses(laws):
    fluids = map(Fluid.dimensionless, laws)
    return [simulate(fluid, TEST, TIMES).first_normal_stress_difference for fluid in fluids]


@pytest.fixture(scope="module")
def problem():
    data = synthetic_dataset("ptt_linear", {"epsilon": 0.4}, FLOWS, duration=8.0, n_samples=41)
    return make_problem(data.runs, Fluid())


@pytest.fixture(scope="module")
def first(problem):
    """What a search leaves that took the rate tensor and passed over the stress."""
    law = initial_law(jax.random.key(0), RECIPE.width, True, jnp.ones(8))
    scale = invariant_sizes(sample_states(law, problem))
    law = initial_law(jax.random.key(0), RECIPE.width, True, scale)
    law = eqx.tree_at(lambda tree: tree.network_mask, law, jnp.zeros(8).at[RATE].set(1.0))
    return Trained(law, law, 1.0, True, "", (RATE,), (STRESS, 0))


@pytest.fixture(scope="module")
def others(problem, first):
    return ensemble.train_others(problem, first, jax.random.split(jax.random.key(1), 2), RECIPE)[0]


@pytest.mark.slow
def test_members_differ_in_their_tensors_and_in_their_weights(first, others):
    masks = [np.flatnonzero(np.asarray(member.law.network_mask)) for member in others]
    np.testing.assert_array_equal(masks[0], [STRESS])  # what came next in the race
    np.testing.assert_array_equal(masks[1], [RATE])  # the first one's
    weights = [np.asarray(m.law.network.layers[0].weight) for m in (first, *others)]
    assert not np.allclose(weights[0], weights[2])


@pytest.mark.slow
def test_every_member_learns(problem, first, others):
    misfits = ensemble.member_misfits([first.law, *(member.law for member in others)], problem)
    assert np.all(misfits[1:] < 0.2 * misfits[0])


@pytest.mark.slow
def test_members_that_fit_disagree_where_shear_stress_does_not_decide(problem, others):
    one, other = first_normal_stresses(member.law for member in others)
    # the truth acts on the stress; a law on the rate tensor has another N1 for the same σ12
    assert np.linalg.norm(one - other) > 0.02 * np.linalg.norm(one)


@pytest.fixture(scope="module")
def constant():
    # runs of the same shape as those of `problem`, for which the programs are there
    data = synthetic_dataset(
        "giesekus", {"alpha": 0.3}, FLOWS, noise=0.005, duration=8.0, n_samples=41
    )
    return TBNNUDE(recipe=RECIPE).fit(data.runs)


@pytest.mark.slow
def test_where_constants_suffice_members_are_drawn_from_what_the_data_leave_of_them(constant):
    assert len(constant.members_) == len(constant.ensemble_fluids_) == 3  # the default
    assert constant.ensemble_ == "drawn from what the data leave of the constants"
    assert constant.law_ is constant.members_[0]
    mobilities = [float(member.constants[3]) for member in constant.members_]
    assert len(set(mobilities)) == 3
    np.testing.assert_allclose(mobilities[0], 0.3, rtol=0.05)


@pytest.mark.slow
def test_members_that_fit_are_handed_on_and_the_others_are_not(constant):
    fits = [member["fits"] for member in constant.result_.details["members"]]
    assert fits[0]
    assert len(constant.fitting_) == sum(fits)
    assert constant.fitting_[0] is constant.law_
    handed_on = constant.result_.members
    assert len(handed_on) == (sum(fits) if sum(fits) > 1 else 0)
    # of the size of the noise: those that fit all data cannot lie far from the truth
    first, *others = first_normal_stresses(constant.fitting_)
    assert all(np.linalg.norm(other - first) < 0.1 * np.linalg.norm(first) for other in others)


def test_the_simplest_of_the_members_that_fit_is_taken(first):
    members = [replace(first, tensors=tuple(range(n))) for n in (3, 1, 2)]
    chosen, fits = ensemble.choose_member(members, np.array([0.0100, 0.0102, 0.0101]), 5e-4)
    assert chosen == 1
    assert np.all(fits)
    # far from the least misfit it would be simple and wrong
    chosen, fits = ensemble.choose_member(members, np.array([0.0100, 0.0300, 0.0101]), 5e-4)
    assert chosen == 2
    np.testing.assert_array_equal(fits, [True, False, True])
    # below what a rheometer resolves all fit
    _, fits = ensemble.choose_member(members, np.array([1e-5, 3e-4, 1e-6]), 5e-4)
    assert np.all(fits)
    _, fits = ensemble.choose_member(members, np.array([1e-2, np.inf, 1e-2]), 5e-4)
    np.testing.assert_array_equal(fits, [True, False, True])


def test_a_descent_ends_at_its_target_or_when_steps_no_longer_pay():
    assert Stopping(1e-3).done(1e-4)
    slow = Stopping(0.0)
    assert [slow.done(1.0 - 1e-5 * i) for i in range(6)] == [False] * 4 + [True, True]
