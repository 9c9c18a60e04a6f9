import dataclasses
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differences import told_as_differences
from independent.homogeneous import GiesekusFluid

from discover.dataset import Run
from discover.forward.fluids import at_samples
from discover.laws import Fluid, Giesekus
from discover.learners.tbnn_ude import TBNNUDE, recipes
from discover.learners.tbnn_ude.problem import DefaultRecipe, make_problem
from discover.learners.tbnn_ude.session import initial_law
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


def predicted(problem, law):
    return problem.flows.over(partial(at_samples, problem.fluid(law))).observed[..., 0]


@pytest.fixture(scope="module")
def giesekus_problem():
    return problem_of("giesekus", {"alpha": 0.3})


@pytest.fixture(scope="module")
def trained(giesekus_problem):
    return recipes.train_default(giesekus_problem, jax.random.key(0), True, SMALL)


def of_random_weights(seed, width):
    return initial_law(jax.random.key(seed), width, True, None, output=0.01)


def test_constants_alone_recover_the_mobility_from_shear_stress(trained):
    assert not trained.varies
    # integration on the training grid errs by 4e-6 of the stress
    np.testing.assert_allclose(trained.law.constants, [0, 0, 0, 0.3, 0, 0, 0, 0], atol=1e-4)
    assert trained.misfit < 1e-5


def test_the_penalty_shrinks_what_the_polish_restores(trained):
    shrunk = float(trained.penalised_law.constants[3])
    assert abs(shrunk - 0.3) > 1e-5
    assert abs(float(trained.law.constants[3]) - 0.3) < abs(shrunk - 0.3)


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


@pytest.mark.slow
def test_the_paper_s_loss_is_a_sum_over_series_plus_the_penalty(giesekus_problem):
    law = of_random_weights(3, 5)
    active = jnp.array([True, False, True])
    loss = float(recipes.paper_loss(law.network, law, giesekus_problem, active, 0.01))
    problem = giesekus_problem
    residual = np.asarray(predicted(problem, law) - problem.records.recorded)
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
    assert float(jnp.max(jnp.abs(predicted(problem, Giesekus(0.3)) - recorded))) < 1e-4
    law = of_random_weights(1, 3)
    along = told_as_differences(problem, law, 1e-5, 1e-6)
    np.testing.assert_allclose(along.recorded, predicted(problem, law), atol=1e-10)
