"""The network in the equation: what it is trained to, what its estimator hands on."""

import dataclasses
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differences import told_as_differences
from independent.homogeneous import GiesekusFluid

import tensor_library as tl
from discover.dataset import Run
from discover.errors import InputError
from discover.forward.fluids import at_samples
from discover.laws import Fluid, Giesekus
from discover.learners.tbnn_ude import TBNNUDE, recipes
from discover.learners.tbnn_ude.least_squares import Cloud, sample_states
from discover.learners.tbnn_ude.problem import DefaultRecipe, make_problem
from discover.learners.tbnn_ude.projection import project
from discover.learners.tbnn_ude.session import initial_law
from discover.protocols import in_flow, oscillatory_shear, start_up
from discover.simulate import simulate, synthetic_dataset

FLOWS = {
    "laos_1_0.5": oscillatory_shear(1.0, 0.5),
    "laos_2_0.5": oscillatory_shear(2.0, 0.5),
    "laos_2_1": oscillatory_shear(2.0, 1.0),
}
SMALL = DefaultRecipe(width=4, steps=6, polish_steps=40, max_tensors=1)


def data_of(law, parameters):
    return synthetic_dataset(law, parameters, FLOWS, duration=10.0, n_samples=51)


def problem_of(law, parameters):
    return make_problem(data_of(law, parameters).runs, Fluid())


def trained(problem, recipe=SMALL, **how):
    return recipes.train_default(problem, jax.random.key(0), True, recipe, **how)


def predicted(problem, law):
    return problem.flows.over(partial(at_samples, problem.fluid(law))).observed[..., 0]


def assert_same_law(one, other):
    for own, same in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        np.testing.assert_array_equal(own, same)


@pytest.fixture(scope="module")
def data():
    return data_of("giesekus", {"alpha": 0.3})


@pytest.fixture(scope="module")
def problem(data):
    return make_problem(data.runs, Fluid())


@pytest.fixture(scope="module")
def model(data):
    return TBNNUDE(recipe=SMALL, n_members=2).fit(data.runs)


def test_constants_recover_the_mobility_that_a_penalty_shrinks_and_a_polish_restores(model):
    # integration on the training grid errs by 4e-6 of the stress
    np.testing.assert_allclose(model.law_.constants, [0, 0, 0, 0.3, 0, 0, 0, 0], atol=1e-4)
    np.testing.assert_array_equal(model.law_.network_mask, 0.0)
    (term,) = model.terms_
    assert term.term == "sigma.sigma"
    assert term.coefficient == pytest.approx(0.3, abs=1e-4)
    assert abs(term.coefficient_penalised - 0.3) > max(1e-5, abs(term.coefficient - 0.3))
    # along trajectories
    table = model.result_.details["coefficients"]
    assert set(table) == set(tl.TENSOR_NAMES)
    assert table["sigma.sigma"]["mean"] == pytest.approx(0.3, abs=1e-4)
    assert table["sigma.sigma"]["spread"] < 1e-9


def test_predictions_follow_the_runs_and_their_order(model, data):
    together = model.predict(data.runs)
    assert together.shape == (3 * 51,)
    np.testing.assert_allclose(together[51:102], data.runs[1].stress, atol=1e-4)
    assert model.score(data.runs) > 0.9999


def test_the_same_key_gives_the_same_law(model, data):
    again = TBNNUDE(recipe=SMALL, n_members=2).fit(data.runs)
    assert again.result_.details["misfit"] == model.result_.details["misfit"]
    assert_same_law(again.law_, model.law_)


def test_maxwell_data_leave_nothing_to_learn():
    # negative control: with −σ known there is no extra term, and none may be invented
    found = trained(problem_of("ucm", {}))
    assert float(jnp.max(jnp.abs(found.law.constants))) < 1e-6
    assert not found.varies


@pytest.mark.slow
def test_the_network_is_called_in_when_constants_leave_structure():
    problem = problem_of("ptt_linear", {"epsilon": 0.4})
    recipe = dataclasses.replace(SMALL, width=6, steps=10, polish_steps=60)
    found = trained(problem, recipe)
    assert found.varies
    # one tensor, the stress itself, with a coefficient that varies: N2 stays exactly zero
    np.testing.assert_array_equal(found.law.network_mask, [0, 1, 0, 0, 0, 0, 0, 0])
    alone = trained(problem, dataclasses.replace(recipe, max_tensors=0))
    assert found.misfit < 0.5 * alone.misfit


def test_units_come_in_through_modulus_and_relaxation_time(data):
    slow = [
        dataclasses.replace(
            run, time=4.0 * run.time, rate=run.rate / 4, stress=50 * run.stress,
            protocol=oscillatory_shear(wi / 4, de / 4),
        )
        for run, (wi, de) in zip(data.runs, [(1, 0.5), (2, 0.5), (2, 1.0)], strict=True)
    ]  # fmt: skip
    known = Fluid(modulus=50.0, relaxation_time=4.0)
    model = TBNNUDE(recipe=SMALL, base=known, n_members=1).fit(slow)
    assert float(model.law_.constants[3]) == pytest.approx(0.3, abs=1e-4)
    assert model.score(slow) > 0.9999


@pytest.mark.slow
def test_modes_of_a_spectrum_share_the_law_that_their_sum_teaches():
    fluid = Fluid(Giesekus(0.3), [70.0, 30.0], [1.0, 0.2])
    times = np.linspace(0.0, 10.0, 51)
    runs = [
        Run(name, times, flow, np.zeros(51), simulate(fluid, flow, times).shear_stress)
        for name, flow in FLOWS.items()
    ]
    known = Fluid(modulus=[70.0, 30.0], relaxation_time=[1.0, 0.2])
    model = TBNNUDE(recipe=SMALL, base=known, n_members=1).fit(runs)
    # integration on the training grid errs by 4e-6 of the stress
    np.testing.assert_allclose(model.law_.constants, [0, 0, 0, 0.3, 0, 0, 0, 0], atol=1e-4)
    np.testing.assert_array_equal(model.fluid_.modulus, [70.0, 30.0])
    # negative control: all of the modulus in the slow mode is another fluid
    assert model.score(runs) > 0.9999
    model.fluid_ = Fluid(model.law_, 100.0, 1.0)
    assert model.set_params(base=Fluid(modulus=100.0)).score(runs) < 0.99


def test_a_solvent_beside_the_modes_leaves_the_same_law(data, model):
    viscous = [dataclasses.replace(run, stress=run.stress + 0.4 * run.rate) for run in data.runs]
    known = Fluid(solvent_viscosity=0.4)
    with_solvent = TBNNUDE(recipe=SMALL, n_members=1, base=known).fit(viscous)
    (term,) = with_solvent.terms_
    # runs weigh by records that hold the solvent's part: what the prior bends differs a little
    assert term.coefficient == pytest.approx(model.terms_[0].coefficient, abs=1e-4)
    assert float(with_solvent.fluid_.solvent_viscosity) == 0.4
    # a network that is told of none finds another law
    assert with_solvent.score(viscous) > 1.0 - 1e-4 > model.score(viscous)


@pytest.mark.parametrize(
    ("options", "message"),
    [({"recipe": "secret"}, "recipe must be one of"), ({"n_members": 0}, "at least 1")],
)
def test_a_wrong_setting_is_refused(data, options, message):
    with pytest.raises(InputError, match=message):
        TBNNUDE(**options).fit(data.runs)


@pytest.mark.slow
def test_the_paper_s_loss_is_a_sum_over_series_plus_the_penalty(problem):
    law = initial_law(jax.random.key(3), 5, True, None, output=0.01)
    active = jnp.array([True, False, True])
    loss = float(recipes.paper_loss(law.network, law, problem, active, 0.01))
    residual = np.asarray(predicted(problem, law) - problem.records.recorded)
    weights = sum(
        float(np.abs(w).sum())
        for w in jax.tree.leaves(eqx.filter(law.network, eqx.is_inexact_array))
    )
    expected = np.mean(residual[0] ** 2) + np.mean(residual[2] ** 2) + 0.01 * weights
    assert loss == pytest.approx(expected, rel=1e-12)


@pytest.mark.slow
def test_the_paper_s_recipe_adds_series_and_lowers_the_loss_within_each(problem):
    recipe = recipes.PaperRecipe(width=4, iterations_per_series=50, learning_rate=3e-3)
    _, losses = recipes.train_paper(problem, jax.random.key(0), True, recipe)
    assert losses.shape == (150,)
    for series in range(3):
        assert losses[50 * series + 49] < losses[50 * series]
    assert losses[50] > losses[49]  # the peak of a series added


@pytest.mark.slow
def test_the_estimator_trains_what_the_paper_s_recipe_does(data, problem):
    recipe = recipes.PaperRecipe(width=4, iterations_per_series=50)
    model = TBNNUDE(recipe=recipe, n_members=1, random_state=3).fit(data.runs)
    (key,) = jax.random.split(jax.random.key(3), 1)
    assert_same_law(model.law_, recipes.train_paper(problem, key, True, recipe)[0])
    assert model.result_.details["recipe"] == "PaperRecipe"


@pytest.mark.slow
def test_an_absurd_learning_rate_is_survived(problem):
    recipe = recipes.PaperRecipe(width=4, iterations_per_series=50, learning_rate=50.0)
    law, losses = recipes.train_paper(problem, jax.random.key(0), True, recipe)
    assert not np.all(np.isfinite(losses))  # some trials did run away
    weights = jax.tree.leaves(eqx.filter(law, eqx.is_array))
    assert all(bool(jnp.all(jnp.isfinite(w))) for w in weights)


@pytest.mark.slow
def test_in_mixed_flows_the_residual_and_its_jacobian_are_those_of_scipy():
    fluid = GiesekusFluid((1.0,), (1.0,), 0.3)
    times = np.linspace(0.1, 3.0, 20)
    runs = [
        Run(kind, times, in_flow(start_up(rate), kind), np.full(20, rate),
            fluid.recorded(kind, lambda _, r=rate: r, times))
        for kind, rate in (("shear", 2.0), ("uniaxial", 0.8))
    ]  # fmt: skip
    problem = make_problem(runs, Fluid())
    recorded = problem.records.recorded
    # the training grid errs by 4e-6 of the stress in shear; extension stretches faster
    assert float(jnp.max(jnp.abs(predicted(problem, Giesekus(0.3)) - recorded))) < 1e-4
    law = initial_law(jax.random.key(1), 3, True, None, output=0.01)
    along = told_as_differences(problem, law, 1e-5, 1e-6)
    np.testing.assert_allclose(along.recorded, predicted(problem, law), atol=1e-10)


def constant_law(constants):
    law = initial_law(jax.random.key(0), 4, True, jnp.ones(8))
    return eqx.tree_at(lambda tree: tree.constants, law, jnp.asarray(constants, float))


@pytest.fixture(scope="module")
def cloud(problem):
    return sample_states(initial_law(jax.random.key(0), 4, True, jnp.ones(8)), problem)


def test_projection_finds_the_two_tensors_of_a_known_network_and_of_nothing_nothing(cloud):
    library = tl.build_library(degree=1)
    projection = project(constant_law([0, 0, 0.1, 0, 0, 0.2, 0, 0]), cloud, library)
    found = {term.term: term.coefficient for term in projection.terms}
    assert found == pytest.approx({"gammadot": 0.1, "sigma.gammadot+gammadot.sigma": 0.2}, abs=1e-8)
    assert projection.misfit < 1e-8
    assert project(constant_law(np.zeros(8)), cloud, library).terms == ()


def test_a_mode_that_the_record_hardly_shows_does_not_choose_the_terms(cloud):
    law = constant_law([0, 0, 0.1, 0, 1e-3, 0, 0, 0])  # 0.1 γ̇ + 0.001 γ̇·γ̇
    library = tl.build_library(degree=0)
    # a slow mode's rate is a thousand times as large, and of its stress the record shows nothing
    both = Cloud(
        jnp.concatenate([cloud.stress, 1e3 * cloud.stress]),
        jnp.concatenate([cloud.rate, 1e3 * cloud.rate]),
        jnp.concatenate([cloud.size, 1e-9 * cloud.size]),
        jnp.concatenate([cloud.weight, 1e-9 * cloud.weight]),
    )
    assert [t.term for t in project(law, both, library, max_terms=1).terms] == ["gammadot"]
    alike = eqx.tree_at(lambda c: c.weight, both, jnp.ones_like(both.weight))
    (other,) = project(law, alike, library, max_terms=1).terms
    assert other.term == "gammadot.gammadot"
