from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import tensor_library as tl
from discover.dataset.run import Run
from discover.errors import InputError
from discover.laws import Fluid, Giesekus
from discover.learners.tbnn_ude import TBNNUDE, DefaultRecipe
from discover.learners.tbnn_ude.least_squares import Cloud, sample_states
from discover.learners.tbnn_ude.problem import make_problem
from discover.learners.tbnn_ude.projection import project
from discover.learners.tbnn_ude.session import initial_law
from discover.protocols import oscillatory_shear
from discover.simulate import simulate, synthetic_dataset

FLOWS = {
    "laos_1_0.5": oscillatory_shear(1.0, 0.5),
    "laos_2_0.5": oscillatory_shear(2.0, 0.5),
    "laos_2_1": oscillatory_shear(2.0, 1.0),
}
SMALL = DefaultRecipe(width=4, steps=6, polish_steps=40, max_tensors=1)


@pytest.fixture(scope="module")
def data():
    return synthetic_dataset("giesekus", {"alpha": 0.3}, FLOWS, duration=10.0, n_samples=51)


@pytest.fixture(scope="module")
def model(data):
    return TBNNUDE(recipe=SMALL, n_members=2).fit(data.runs)


def test_the_result_says_in_words_what_was_learned(model):
    (term,) = model.terms_
    assert term.term == "sigma.sigma"
    assert term.coefficient == pytest.approx(0.3, abs=1e-4)
    assert term.coefficient_penalised is not None
    assert abs(term.coefficient_penalised - 0.3) > 1e-5


def test_coefficients_along_trajectories_are_reported_with_their_spread(model):
    table = model.result_.details["coefficients"]
    assert set(table) == set(tl.TENSOR_NAMES)
    assert table["sigma.sigma"]["mean"] == pytest.approx(0.3, abs=1e-4)
    assert table["sigma.sigma"]["spread"] < 1e-9


def test_predictions_follow_the_runs_and_their_order(model, data):
    together = model.predict(data.runs)
    assert together.shape == (3 * 51,)
    np.testing.assert_allclose(together[51:102], data.runs[1].stress, atol=1e-4)
    assert model.score(data.runs) > 0.9999


def test_units_come_in_through_modulus_and_relaxation_time(data):
    slow = [
        replace(
            run,
            time=4.0 * run.time,
            rate=run.rate / 4,
            stress=50 * run.stress,
            protocol=oscillatory_shear(wi / 4, de / 4),
        )
        for run, (wi, de) in zip(data.runs, [(1, 0.5), (2, 0.5), (2, 1.0)], strict=True)
    ]
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


@pytest.mark.parametrize(
    ("options", "message"),
    [({"recipe": "secret"}, "recipe must be one of"), ({"n_members": 0}, "at least 1")],
)
def test_a_wrong_setting_is_refused(data, options, message):
    with pytest.raises(InputError, match=message):
        TBNNUDE(**options).fit(data.runs)


@pytest.fixture(scope="module")
def cloud(data):
    law = initial_law(jax.random.key(0), 4, True, jnp.ones(8))
    return sample_states(law, make_problem(data.runs, Fluid()))


def constant_law(constants):
    import equinox as eqx

    law = initial_law(jax.random.key(0), 4, True, jnp.ones(8))
    return eqx.tree_at(lambda tree: tree.constants, law, jnp.asarray(constants, float))


def test_projection_finds_the_two_tensors_of_a_known_network(cloud):
    law = constant_law([0, 0, 0.1, 0, 0, 0.2, 0, 0])
    projection = project(law, cloud, tl.build_library(degree=1))
    found = {term.term: term.coefficient for term in projection.terms}
    assert found == pytest.approx({"gammadot": 0.1, "sigma.gammadot+gammadot.sigma": 0.2}, abs=1e-8)
    assert projection.misfit < 1e-8


def test_a_mode_that_the_record_hardly_shows_does_not_choose_the_terms(cloud):
    import equinox as eqx

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


def test_projection_of_nothing_is_nothing(cloud):
    assert project(constant_law(np.zeros(8)), cloud, tl.build_library(degree=1)).terms == ()


def test_a_solvent_beside_the_modes_leaves_the_same_law(data, model):
    viscous = [replace(run, stress=run.stress + 0.4 * run.rate) for run in data.runs]
    known = Fluid(solvent_viscosity=0.4)
    with_solvent = TBNNUDE(recipe=SMALL, n_members=1, base=known).fit(viscous)
    (term,) = with_solvent.terms_
    # runs weigh by records that hold the solvent's part: what the prior bends differs a little
    assert term.coefficient == pytest.approx(model.terms_[0].coefficient, abs=1e-4)
    assert float(with_solvent.fluid_.solvent_viscosity) == 0.4
    # a network that is told of none finds another law
    assert with_solvent.score(viscous) > 1.0 - 1e-4 > model.score(viscous)
