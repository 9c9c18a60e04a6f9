import json
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from shared_flows import LIBRARY, small_dataset, with_normal_stresses
from sklearn.model_selection import GridSearchCV, KFold

from discover.errors import InputError
from discover.laws import Fluid, Giesekus, LibraryExpansion, UpperConvectedMaxwell
from discover.learners.tensor_sindy import OPTIMISERS, TensorSINDy
from discover.simulate import simulate

EXPONENTIAL = "(exp(epsilon*tr(sigma))-1)*sigma"
# a law of one term is held against all of two, and more is as long a search again
OF_TWO = {"max_terms": 2}


def found(model):
    return {term.term: term.coefficient for term in model.terms_}


def simulated(fluid, runs):
    """Return the runs with what a fluid would record."""
    return [
        replace(run, stress=simulate(fluid, run.protocol, run.time).shear_stress) for run in runs
    ]


@pytest.fixture(scope="module")
def giesekus():
    # as many terms as other tests here ask for, so that they share programs
    return TensorSINDy(LIBRARY, max_terms=2).fit(small_dataset("giesekus", {"alpha": 0.2}))


def test_giesekus_comes_back_alone_and_without_twins_in_the_library(giesekus):
    assert not any(r["exact"] for r in giesekus.result_.details["rivals"])
    assert set(found(giesekus)) == {"sigma.sigma"}
    # the fixed-step integration is good to 1e-6 of the stress
    assert found(giesekus)["sigma.sigma"] == pytest.approx(0.2, abs=1e-5)
    assert giesekus.score(small_dataset("giesekus", {"alpha": 0.2})) > 1.0 - 1e-5


def test_normal_stresses_that_were_never_seen_are_predicted(giesekus):
    dataset = small_dataset("giesekus", {"alpha": 0.2})
    name = dataset.names[-1]
    predicted = simulate(giesekus.fluid_, dataset[name].protocol, dataset[name].time)
    exact = dataset.exact[name]
    assert np.max(np.abs(predicted.components - exact.components)) < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("optimizer", OPTIMISERS)
def test_every_optimiser_finds_linear_ptt_in_noise(optimizer):
    # The library holds the exponential form too, which with a small ε imitates the linear one:
    # its inner parameter has to be paid for
    dataset = small_dataset("ptt_linear", {"epsilon": 0.4}, noise=0.02, seed=3)
    model = TensorSINDy(LIBRARY, optimizer).fit(dataset)
    assert set(found(model)) == {"tr(sigma)*sigma"}
    term = model.terms_[0]
    # 260 samples at 2 %: a standard error of about 0.004
    assert term.coefficient == pytest.approx(0.4, abs=0.016)
    assert term.ci95[0] < term.coefficient < term.ci95[1]
    assert term.ci95[1] - term.ci95[0] < 0.04
    assert term.coefficient_penalised == pytest.approx(0.4, rel=0.2)


def test_noise_alone_brings_in_no_term():
    # the whole width: the more terms are tried, the likelier noise looks like some of them
    model = TensorSINDy(LIBRARY).fit(small_dataset("ucm", noise=0.02, seed=1))
    assert model.terms_ == ()
    assert model.result_.details["chosen"] == 0


@pytest.mark.slow
def test_twins_in_shear_stress_are_listed_and_the_simplest_is_chosen():
    dataset = small_dataset("johnson_segalman", {"xi": 0.4})
    model = TensorSINDy(LIBRARY).fit(dataset)
    assert set(found(model)) == {"sigma.gammadot+gammadot.sigma"}
    assert found(model)["sigma.gammadot+gammadot.sigma"] == pytest.approx(0.2, abs=1e-5)
    ties = {r["support"][0]: r for r in model.result_.details["rivals"] if r["exact"]}
    # ξ(1 − ξ/2) = 0.32
    assert ties["tr(sigma)*gammadot"]["coefficients"][0] == pytest.approx(0.32, abs=1e-4)

    # N2 is −(ξ/2) N1 in one and 0 in the other: measured, it ends the tie
    observed = with_normal_stresses(dataset)
    informed = TensorSINDy(LIBRARY, use_normal_stresses=True).fit(observed)
    assert set(found(informed)) == {"sigma.gammadot+gammadot.sigma"}
    assert informed.result_.details["n_observations"] == 3 * model.result_.details["n_observations"]
    assert not any(r["exact"] for r in informed.result_.details["rivals"])


@pytest.mark.slow
def test_exponential_ptt_comes_back_with_its_inner_parameter():
    data = small_dataset("ptt_exponential", {"epsilon": 0.4})
    model = TensorSINDy(LIBRARY, **OF_TWO).fit(data)
    assert set(found(model)) == {EXPONENTIAL}
    assert found(model)[EXPONENTIAL] == pytest.approx(1.0, abs=1e-3)
    assert model.terms_[0].inner["epsilon"] == pytest.approx(0.4, abs=1e-3)


def test_a_coefficient_that_is_not_one_is_not_taken_for_it():
    law = LibraryExpansion(
        jnp.array([0.5]), jnp.array([0.7]), LIBRARY.subset([LIBRARY.names.index(EXPONENTIAL)])
    )
    runs = simulated(Fluid.dimensionless(law), small_dataset("ptt_exponential", {"epsilon": 0.4}))
    (term,) = TensorSINDy(LIBRARY, **OF_TWO).fit(runs).terms_
    assert term.coefficient == pytest.approx(0.5, abs=1e-3)
    assert term.inner["epsilon"] == pytest.approx(0.7, abs=1e-3)


def test_a_redundant_first_pick_leaves():
    # Of single terms tr(σ)σ imitates this law best, but it is no part of it
    index = [LIBRARY.names.index(name) for name in ("sigma", "tr(sigma)^2*sigma")]
    law = LibraryExpansion(jnp.array([0.2, 0.15]), jnp.zeros(0), LIBRARY.subset(index))
    runs = simulated(Fluid.dimensionless(law), small_dataset("ucm"))
    polynomials = TensorSINDy(LIBRARY, **OF_TWO).fit(runs)
    assert polynomials.search_.path()[1].names != ("sigma",)
    assert set(found(polynomials)) == {"sigma", "tr(sigma)^2*sigma"}
    assert found(polynomials)["sigma"] == pytest.approx(0.2, abs=1e-4)


@pytest.mark.slow
def test_modes_share_one_law_of_which_not_even_the_relaxation_is_known():
    modulus, relaxation_time = [30.0, 10.0], [0.5, 3.0]
    truth = Fluid(Giesekus(0.3), modulus, relaxation_time)
    runs = simulated(truth, small_dataset("ucm"))
    known = Fluid(UpperConvectedMaxwell(False), modulus, relaxation_time)
    model = TensorSINDy(LIBRARY, base=known).fit(runs)
    assert set(found(model)) == {"sigma", "sigma.sigma"}
    assert found(model)["sigma"] == pytest.approx(1.0, abs=1e-4)
    assert found(model)["sigma.sigma"] == pytest.approx(0.3, abs=1e-4)
    assert not model.law_.linear_relaxation


def test_result_is_json_and_the_path_runs_from_empty(giesekus):
    details = json.loads(json.dumps(giesekus.result_.details))
    assert [row["size"] for row in details["path"]] == list(range(len(details["path"])))
    assert details["path"][0]["support"] == []
    assert details["path"][details["chosen"]]["support"] == ["sigma.sigma"]
    assert {"support", "size", "misfit", "held_out", "log_evidence"} <= set(details["path"][1])


def test_runs_may_come_one_after_another(giesekus):
    model = TensorSINDy(LIBRARY, max_terms=1)
    model.fit(iter(small_dataset("giesekus", {"alpha": 0.2}).runs))
    assert found(model) == pytest.approx(found(giesekus), rel=1e-9)


@pytest.mark.slow
def test_a_grid_search_of_scikit_learn_takes_the_library_that_has_the_term():
    runs = list(small_dataset("giesekus", {"alpha": 0.2}))
    choices = {"library": [LIBRARY.subset([LIBRARY.names.index("I")]), LIBRARY]}
    model = TensorSINDy(LIBRARY, max_terms=1)
    grid = GridSearchCV(model, choices, cv=KFold(2), refit=False).fit(runs)
    # a library that lacks the term leaves the empty law, which predicts worse
    assert grid.best_params_ == {"library": LIBRARY}
    assert not hasattr(model, "law_")


@pytest.mark.usefixtures("as_users_run_it")
@pytest.mark.parametrize(
    ("parameters", "runs", "message"),
    [
        ({"library": ["sigma"]}, None, "TermLibrary"), ({"max_terms": 0}, None, "max_terms"),
        ({}, [], "at least one run"), ({}, [1.0, 2.0], "Run"),
    ],
)  # fmt: skip
def test_bad_parameters_and_runs_give_one_clear_error(parameters, runs, message):
    with pytest.raises(InputError, match=message):
        TensorSINDy(**parameters).fit(small_dataset("ucm") if runs is None else runs)
