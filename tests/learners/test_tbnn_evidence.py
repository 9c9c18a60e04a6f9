"""Several networks that fit alike: members by different ways, and the likelier of them."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differences import nearly_giesekus
from independent import RoliePoly
from independent import start_up as flow_at
from noisy_runs import waves

from discover.laws import Fluid
from discover.learners.tbnn_ude import TBNNUDE, DefaultRecipe, ensemble, evidence
from discover.learners.tbnn_ude.least_squares import Stopping, sample_states
from discover.learners.tbnn_ude.problem import Trained, make_problem
from discover.learners.tbnn_ude.recipes import train_default
from discover.learners.tbnn_ude.session import initial_law, invariant_sizes
from discover.learners.tbnn_ude.variational import trajectories
from discover.protocols import oscillatory_shear, start_up
from discover.simulate import simulate, synthetic_dataset

FLOWS = {f"laos_{wi:g}_0.5": oscillatory_shear(wi, 0.5) for wi in (1.0, 2.0)}
TEST, TIMES = start_up(2.0), np.linspace(0.0, 8.0, 41)
RECIPE = DefaultRecipe(width=6, steps=8, polish_steps=20, max_tensors=1)
NOISE, STRESS, RATE = 0.01, 1, 2
FLUID = RoliePoly(1.0, 0.1)


def made(law, parameters, noise=0.0):
    return synthetic_dataset(law, parameters, FLOWS, noise=noise, duration=8.0, n_samples=41).runs


def responses(laws, flow=TEST):
    return [simulate(Fluid.dimensionless(law), flow, TIMES) for law in laws]


def first_normal_stresses(laws):
    return [one.first_normal_stress_difference for one in responses(laws)]


def apart(one, other):
    return np.linalg.norm(other - one) / np.linalg.norm(one)


@pytest.fixture(scope="module")
def problem():
    return make_problem(made("ptt_linear", {"epsilon": 0.4}), Fluid())


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
def test_members_differ_in_tensors_and_weights_and_every_one_learns(problem, first, others):
    masks = [np.flatnonzero(np.asarray(member.law.network_mask)) for member in others]
    np.testing.assert_array_equal(masks[0], [STRESS])  # what came next in the race
    np.testing.assert_array_equal(masks[1], [RATE])  # the first one's
    weights = [np.asarray(m.law.network.layers[0].weight) for m in (first, *others)]
    assert not np.allclose(weights[0], weights[2])
    misfits = ensemble.member_misfits([first.law, *(member.law for member in others)], problem)
    assert np.all(misfits[1:] < 0.2 * misfits[0])
    # the truth acts on the stress; a law on the rate tensor has another N1 for the same σ12
    assert apart(*first_normal_stresses(member.law for member in others)) > 0.02


@pytest.fixture(scope="module")
def constant():
    # runs of the same shape as those of `problem`, for which the programs are there
    return TBNNUDE(recipe=RECIPE).fit(made("giesekus", {"alpha": 0.3}, noise=0.005))


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
    assert len(constant.result_.members) == (sum(fits) if sum(fits) > 1 else 0)
    # of the size of the noise: those that fit all data cannot lie far from the truth
    first, *others = first_normal_stresses(constant.fitting_)
    assert all(apart(first, other) < 0.1 for other in others)


@pytest.mark.parametrize(
    ("misfits", "chosen", "fits"),
    [
        ([0.0100, 0.0102, 0.0101], 1, [True, True, True]),
        # far from the least misfit it would be simple and wrong
        ([0.0100, 0.0300, 0.0101], 2, [True, False, True]),
        # below what a rheometer resolves all fit
        ([1e-5, 3e-4, 1e-6], 2, [True, True, True]),
        ([1e-2, np.inf, 1e-2], 2, [True, False, True]),
    ],
)
def test_the_simplest_of_the_members_that_fit_is_taken(first, misfits, chosen, fits):
    members = [replace(first, tensors=tuple(range(n))) for n in (3, 1, 2)]
    found = ensemble.choose_member(members, np.array(misfits), 5e-4)
    assert (found[0], list(found[1])) == (chosen, fits)


def test_a_descent_ends_at_its_target_or_when_steps_no_longer_pay():
    assert Stopping(1e-3).done(1e-4)
    slow = Stopping(0.0)
    assert [slow.done(1.0 - 1e-5 * i) for i in range(6)] == [False] * 4 + [True, True]


@pytest.fixture(scope="module")
def noisy():
    """Noisy σ12 of a fluid that is no sum of tensors with one varying coefficient."""
    amplitudes = (1.0, 0.5), (2.0, 0.5), (2.0, 1.0)
    return make_problem(waves(FLUID, amplitudes, TIMES, NOISE).runs, Fluid())


@pytest.fixture(scope="module")
def law():
    """A law whose eight coefficients vary a little about those of a Giesekus fluid."""
    return nearly_giesekus(0.3, RECIPE.width)


@pytest.fixture(scope="module")
def own(noisy, law):
    """What that law does, with noise."""
    seen = trajectories(law, noisy).recorded
    noise = np.random.default_rng(1).standard_normal(seen.shape)
    size = NOISE * jnp.sqrt(jnp.mean(seen**2, axis=1, keepdims=True))
    return eqx.tree_at(lambda tree: tree.records.recorded, noisy, seen + size * noise)


@pytest.mark.slow
def test_what_fits_alike_is_decided_by_evidence_and_not_by_a_function_that_bends(noisy):
    trained = train_default(noisy, jax.random.key(0), True, RECIPE)
    assert trained.others
    laws = [trained.law, trained.others[0].law]
    values = evidence.negative_log_evidence(laws, noisy)
    assert values[0] <= values[1]
    true = FLUID.respond(flow_at(2.0), TIMES).N1
    # σ12 leaves N1 open, so no small error is asked for: only the smaller one of the two
    chosen, other = (apart(true, found) for found in first_normal_stresses(laws))
    assert chosen < other


def test_a_law_that_leaves_more_than_noise_is_less_likely(own, law):
    worse = eqx.tree_at(lambda tree: tree.constants, law, law.constants.at[3].add(0.3))
    values = evidence.negative_log_evidence([worse, law], own)[::-1]
    assert values[1] > values[0] + 100.0


def test_of_laws_that_leave_the_same_the_one_that_was_told_less_is_likelier(own, law):
    def outputs(tree):
        return tree.network.layers[-1].weight

    idle = eqx.tree_at(outputs, law, jnp.zeros_like(outputs(law)))
    # hidden weights that no output reads change no prediction, and had to be told all the same
    told = eqx.tree_at(
        lambda tree: tree.network.layers[0].weight, idle, 5.0 * idle.network.layers[0].weight
    )
    values = evidence.negative_log_evidence([told, idle], own)
    assert values[0] > values[1]


def test_a_law_that_runs_away_at_twice_the_rate_is_taken_only_for_want_of_another(own, law):
    # a negative coefficient of σ·σ hardens: a little of it shows at high rates only
    # (0.05 N1 is a quarter of the relaxation at Wi = 2, where N1 is about 5, and all of it at 4)
    wild = eqx.tree_at(
        lambda tree: (tree.constants, tree.network_mask),
        law,
        (jnp.zeros(8).at[3].set(-0.05), jnp.zeros(8)),
    )
    assert evidence.stable_at_double_rate(law, evidence.at_twice_the_rate(own))
    assert np.all(np.isfinite(trajectories(wild, own).states))
    assert not evidence.stable_at_double_rate(wild, evidence.at_twice_the_rate(own))
    assert np.isfinite(evidence.negative_log_evidence([law, wild], own)).tolist() == [True, False]
    assert np.isfinite(evidence.negative_log_evidence([wild], own)[0])


@pytest.mark.slow
def test_draws_of_the_posterior_fit_alike_and_are_other_laws(own, law):
    fits = 1.25
    drawn = evidence.posterior_draws(law, own, jax.random.split(jax.random.key(2), 3), fits)
    assert len(drawn) == 3
    misfits = ensemble.member_misfits([law, *drawn], own)
    assert np.all(misfits[1:] <= fits * misfits[0])
    # in the second run σ12 was seen, with this noise; N1 by nobody, and differs by far more than
    # the 1e-8 to which it is integrated
    first, *others = responses([law, *drawn], oscillatory_shear(2.0, 0.5))
    for other in others:
        assert apart(first.shear_stress, other.shear_stress) < NOISE
        normal = (one.first_normal_stress_difference for one in (first, other))
        assert apart(*normal) > 1e-5
