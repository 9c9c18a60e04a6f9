import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differences import told_as_differences
from independent.homogeneous import GiesekusFluid

from discover.dataset import Run
from discover.laws import Fluid, Giesekus
from discover.learners.tbnn_ude import TBNNUDE, least_squares, recipes
from discover.learners.tbnn_ude.problem import DefaultRecipe, make_problem
from discover.learners.tbnn_ude.session import Session, initial_law, is_white
from discover.learners.tbnn_ude.variational import Rebuild, side_by_side, states_and_jacobian
from discover.protocols import in_flow, oscillatory_shear, start_up
from discover.simulate import synthetic_dataset

FLOWS = {
    "laos_1_0.5": oscillatory_shear(1.0, 0.5),
    "laos_2_0.5": oscillatory_shear(2.0, 0.5),
    "laos_2_1": oscillatory_shear(2.0, 1.0),
}
SMALL = DefaultRecipe(width=4, steps=6, polish_steps=40, max_tensors=1)


def problem_of(law, parameters, **options):
    data = synthetic_dataset(law, parameters, FLOWS, duration=10.0, n_samples=51, **options)
    return make_problem(data.runs, Fluid())


@pytest.fixture(scope="module")
def giesekus_problem():
    return problem_of("giesekus", {"alpha": 0.3})


@pytest.fixture(scope="module")
def trained(giesekus_problem):
    return recipes.train_default(giesekus_problem, jax.random.key(0), True, SMALL)


def of_random_weights(seed, width):
    return initial_law(jax.random.key(seed), width, True, None, output=0.01)


@pytest.mark.slow
def test_the_jacobian_of_the_variational_equation_is_that_of_the_trajectory(giesekus_problem):
    law = of_random_weights(1, 3)
    # truncation of order step², rounding of order 1e-16/step
    told_as_differences(giesekus_problem, law, 1e-5, 1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("n", [1, 2, 3])
def test_halves_of_the_runs_side_by_side_are_all_runs_at_once(giesekus_problem, n):
    law = of_random_weights(1, 3)
    rebuild = Rebuild.everything(law)
    whole = giesekus_problem

    def of_runs(p):
        return p.records.recorded, p.records.weight, p.stress

    problem = eqx.tree_at(of_runs, whole, [column[:n] for column in of_runs(whole)])
    problem = eqx.tree_at(lambda p: p.flows, problem, whole.flows.some(0, n))
    together = states_and_jacobian(rebuild.start, rebuild, giesekus_problem)
    halves = side_by_side(rebuild.start, rebuild, problem)
    pairs = zip(jax.tree.leaves(halves), jax.tree.leaves(together), strict=True)
    for half, whole in pairs:
        # no more than the rounding of instructions of another width
        np.testing.assert_allclose(half, whole[:n], rtol=1e-10, atol=1e-13)


def test_constants_alone_recover_the_mobility_from_shear_stress(trained):
    assert not trained.varies
    # integration on the training grid errs by 4e-6 of the stress
    np.testing.assert_allclose(trained.law.constants, [0, 0, 0, 0.3, 0, 0, 0, 0], atol=1e-4)
    assert trained.misfit < 1e-5


def test_the_penalty_shrinks_what_the_polish_restores(trained):
    shrunk = float(trained.penalised_law.constants[3])
    assert abs(shrunk - 0.3) > 1e-5
    assert abs(float(trained.law.constants[3]) - 0.3) < abs(shrunk - 0.3)


def test_constants_without_a_network_are_those_beside_one_that_is_zero(giesekus_problem, trained):
    whole = initial_law(jax.random.key(0), SMALL.width, True, jnp.ones(8))
    _, law = Session(giesekus_problem, SMALL, None).constants(whole)
    # the same steps, to rounding
    np.testing.assert_allclose(trained.law.constants, law.constants, atol=1e-9)
    assert trained.law.network is None  # so that nothing is compiled or kept of one


def test_maxwell_data_leave_nothing_to_learn():
    # negative control: with −σ known there is no extra term, and none may be invented
    trained = recipes.train_default(problem_of("ucm", {}), jax.random.key(0), True, SMALL)
    assert float(jnp.max(jnp.abs(trained.law.constants))) < 1e-6
    assert not trained.varies


@pytest.mark.slow
def test_the_network_is_called_in_when_constants_leave_structure():
    problem = problem_of("ptt_linear", {"epsilon": 0.4})
    recipe = dataclasses.replace(SMALL, width=6, steps=10, polish_steps=60)
    trained = recipes.train_default(problem, jax.random.key(0), True, recipe)
    assert trained.varies
    # one tensor, the stress itself, with a coefficient that varies: N2 stays exactly zero
    np.testing.assert_array_equal(trained.law.network_mask, [0, 1, 0, 0, 0, 0, 0, 0])
    constants = dataclasses.replace(recipe, max_tensors=0)
    alone = recipes.train_default(problem, jax.random.key(0), True, constants)
    assert trained.misfit < 0.5 * alone.misfit


def test_the_same_key_gives_the_same_law(giesekus_problem, trained):
    again = recipes.train_default(giesekus_problem, jax.random.key(0), True, SMALL)
    assert again.misfit == trained.misfit
    for one, two in zip(jax.tree.leaves(again.law), jax.tree.leaves(trained.law), strict=True):
        np.testing.assert_array_equal(one, two)


def test_a_start_that_runs_away_neither_crashes_nor_gives_nan(giesekus_problem):
    law = initial_law(jax.random.key(0), 4, True, jnp.ones(8))
    good = law
    law = eqx.tree_at(lambda tree: tree.constants, law, jnp.zeros(8).at[3].set(-8.0))
    rebuild = Rebuild.of_constants(law, np.ones(8, bool), np.ones(8))
    cloud = least_squares.sample_states(good, giesekus_problem)
    objective = least_squares.Objective(
        giesekus_problem, rebuild, cloud, least_squares.reweighted(good, cloud, 1e-3)
    )
    weights = least_squares.minimise(rebuild.start, objective, 3)
    assert np.all(np.isfinite(weights))


def test_the_prior_is_the_sum_of_root_mean_squares_at_its_fixed_point(giesekus_problem):
    law = initial_law(jax.random.key(0), 4, True, jnp.ones(8))
    law = eqx.tree_at(lambda tree: tree.constants, law, jnp.array([0, 0.5, 0.0, 0.3, 0, 0, 0, 0]))
    cloud = least_squares.sample_states(law, giesekus_problem)
    value = float(
        jnp.sum(
            least_squares.prior_residual(law, cloud, least_squares.reweighted(law, cloud, 0.01))
            ** 2
        )
    )
    amount, variation = least_squares.parts(law, cloud)
    expected = 0.01 * float(jnp.sum(jnp.sqrt(jnp.mean(amount**2, axis=0))))
    assert float(jnp.max(jnp.abs(variation))) < 1e-12  # constants do not vary
    assert value == pytest.approx(expected, rel=2e-3)  # the floor of 1e-4 in the weights


@pytest.mark.parametrize(("seed", "kind"), [(0, "white"), (1, "walk")])
def test_whiteness_tells_noise_from_structure(seed, kind):
    noise = np.random.default_rng(seed).standard_normal((4, 200))
    mask = np.ones((4, 200), bool)
    if kind == "white":
        assert is_white(noise, mask)
    else:
        assert not is_white(noise.cumsum(axis=1), mask)


@pytest.mark.slow
def test_the_paper_s_loss_is_a_sum_over_series_plus_the_penalty(giesekus_problem):
    law = of_random_weights(3, 5)
    active = jnp.array([True, False, True])
    loss = float(recipes.paper_loss(law.network, law, giesekus_problem, active, 0.01))
    problem = giesekus_problem
    residual = np.asarray(problem.predicted(law) - problem.records.recorded)
    weights = sum(
        float(np.abs(w).sum())
        for w in jax.tree.leaves(eqx.filter(law.network, eqx.is_inexact_array))
    )
    expected = np.mean(residual[0] ** 2) + np.mean(residual[2] ** 2) + 0.01 * weights
    assert loss == pytest.approx(expected, rel=1e-12)


@pytest.mark.slow
def test_the_paper_s_recipe_adds_series_and_lowers_the_loss_within_each(giesekus_problem):
    recipe = recipes.PaperRecipe(width=4, iterations_per_series=50, learning_rate=3e-3)
    _, losses = recipes.train_paper(giesekus_problem, jax.random.key(0), True, recipe)
    assert losses.shape == (150,)
    for series in range(3):
        assert losses[50 * series + 49] < losses[50 * series]
    assert losses[50] > losses[49]  # the peak of a series added


@pytest.mark.slow
def test_the_estimator_trains_what_the_paper_s_recipe_does(giesekus_problem):
    recipe = recipes.PaperRecipe(width=4, iterations_per_series=50)
    data = synthetic_dataset("giesekus", {"alpha": 0.3}, FLOWS, duration=10.0, n_samples=51)
    model = TBNNUDE(recipe=recipe, n_members=1, random_state=3).fit(data.runs)
    (key,) = jax.random.split(jax.random.key(3), 1)
    law, _ = recipes.train_paper(giesekus_problem, key, True, recipe)
    for one, two in zip(jax.tree.leaves(model.law_), jax.tree.leaves(law), strict=True):
        np.testing.assert_array_equal(one, two)
    assert model.result_.details["recipe"] == "PaperRecipe"


@pytest.mark.slow
def test_an_absurd_learning_rate_is_survived(giesekus_problem):
    recipe = recipes.PaperRecipe(width=4, iterations_per_series=50, learning_rate=50.0)
    law, losses = recipes.train_paper(giesekus_problem, jax.random.key(0), True, recipe)
    assert not np.all(np.isfinite(losses))  # some trials did run away
    assert all(
        bool(jnp.all(jnp.isfinite(w))) for w in jax.tree.leaves(eqx.filter(law, eqx.is_array))
    )


@pytest.mark.slow
def test_the_network_stands_on_a_known_base_law():
    data = synthetic_dataset("giesekus", {"alpha": 0.3}, FLOWS, duration=10.0, n_samples=51)
    problem = make_problem(data.runs, Fluid())
    trained = recipes.train_default(problem, jax.random.key(0), True, SMALL, base_law=Giesekus(0.1))
    assert float(trained.law.constants[3]) == pytest.approx(0.2, abs=1e-4)  # the rest of 0.3


def test_a_descent_far_behind_its_rival_is_given_up_and_one_close_behind_is_not():
    pace = [1.0 / 2**step for step in range(10)]

    def steps_until_given_up(times_worse):
        stopping = least_squares.Stopping(0.0, pace)
        misfits = (times_worse * value for value in pace)
        return next((i for i, misfit in enumerate(misfits) if stopping.done(misfit)), len(pace))

    assert steps_until_given_up(10.0) < len(pace)
    assert steps_until_given_up(2.0) == len(pace)


@pytest.mark.slow
def test_in_mixed_flows_the_residual_and_its_jacobian_are_those_of_scipy():
    fluid = GiesekusFluid((1.0,), (1.0,), 0.3)
    times = np.linspace(0.1, 3.0, 20)
    runs = [
        Run(
            kind,
            times,
            in_flow(start_up(rate), kind),
            np.full(20, rate),
            fluid.recorded(kind, lambda _, r=rate: r, times),
        )
        for kind, rate in (("shear", 2.0), ("uniaxial", 0.8))
    ]
    problem = make_problem(runs, Fluid())
    recorded = problem.records.recorded
    # the training grid errs by 4e-6 of the stress in shear; extension stretches faster
    assert float(jnp.max(jnp.abs(problem.predicted(Giesekus(0.3)) - recorded))) < 1e-4
    law = of_random_weights(1, 3)
    along = told_as_differences(problem, law, 1e-5, 1e-6)
    np.testing.assert_allclose(along.recorded, problem.predicted(law), atol=1e-10)
