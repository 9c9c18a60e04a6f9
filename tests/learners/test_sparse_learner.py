"""The sparse learner: its optimisers, correlated noise, records of zero, and strong flows."""

import numpy as np
import pysindy
import pytest
from independent import multimode_giesekus
from independent.noise import correlated
from noisy_runs import run_at, start_ups
from shared_flows import LIBRARY

import discover as dc
from discover.errors import InputError
from discover.learners.tensor_sindy.optimisers import OPTIMISERS, check_optimiser, solve_sparse

TRUTH = {2: 3.0, 7: -0.01}


def planted(noise=0.0):
    generator = np.random.default_rng(1)
    design = generator.normal(size=(300, 12)) * np.geomspace(1e-3, 1e3, 12)
    target = sum(c * design[:, i] for i, c in TRUTH.items())
    return design, target + noise * np.std(target) * generator.normal(size=300)


@pytest.mark.parametrize("name", OPTIMISERS)
def test_planted_terms_are_proposed_whatever_their_units(name):
    design, target = planted(noise=0.01)
    supports = solve_sparse(name, design, target, max_terms=4)
    assert tuple(TRUTH) in supports
    coefficients = supports[tuple(TRUTH)][list(TRUTH)]
    # noise of 1 % over 300 rows, and the bias of what the optimiser itself shrinks
    np.testing.assert_allclose(coefficients, list(TRUTH.values()), rtol=0.15)


@pytest.mark.parametrize("name", OPTIMISERS)
def test_a_zero_column_is_never_proposed_and_a_repeated_one_does_no_harm(name):
    design, target = planted()
    design = np.column_stack([design, np.zeros(300), design[:, 2]])
    solutions = solve_sparse(name, design, target, 4)
    assert solutions
    assert all(12 not in support for support in solutions)


def test_no_signal_gives_no_proposal():
    assert solve_sparse("stlsq", np.ones((5, 2)), np.zeros(5), 2) == {}
    assert solve_sparse("stlsq", np.zeros((5, 2)), np.ones(5), 2) == {}


def test_a_pysindy_optimiser_is_used_as_set_and_left_as_it_was():
    design, target = planted()
    optimiser = pysindy.STLSQ(threshold=0.01, alpha=1e-6)
    before = dict(optimiser.get_params())
    solutions = solve_sparse(optimiser, design, target, 4)
    assert list(solutions) == [tuple(TRUTH)]
    assert optimiser.get_params() == before
    assert not hasattr(optimiser, "coef_")


@pytest.mark.parametrize("bad", ["lasso?", 3])
def test_an_unknown_optimiser_is_refused_with_the_known_ones_listed(bad):
    with pytest.raises(InputError, match="stlsq, sr3, ssr, frols"):
        check_optimiser(bad)


TIMES = np.linspace(0.02, 6.0, 150)
RATES = (0.5, 1.0, 2.0, 4.0)
NOISE = 0.03


def runs(correlation, seed):
    """Return start-ups of an upper-convected Maxwell fluid, whose σ12 is γ̇ (1 − e^−t)."""
    generator = np.random.default_rng([7, seed])
    noisy = (correlated(-r * np.expm1(-TIMES), NOISE, correlation, generator) for r in RATES)
    return [run_at(rate, TIMES, stress) for rate, stress in zip(RATES, noisy, strict=True)]


def fitted(correlation, seed):
    return dc.TensorSINDy(LIBRARY).fit(runs(correlation, seed))


def worth(model):
    return model.result_.details["noise"]["effective_samples"]


@pytest.mark.slow
def test_correlated_noise_seldom_brings_in_a_term():
    # counting every sample, all four have terms, three to five of them
    models = [fitted(0.9, seed) for seed in range(4)]
    assert sum(model.terms_ != () for model in models) <= 1
    # (1 − 0.9)/(1 + 0.9) of 600 samples are 32; the correlation is told in steps of 0.07
    assert all(15 < worth(model) < 80 for model in models if not model.terms_)


@pytest.mark.parametrize("learner", [dc.TensorSINDy(), dc.TBNNUDE()])
def test_a_record_that_is_zero_throughout_is_refused(learner):
    records = {"a.csv": -np.expm1(-TIMES), "b.csv": 0.0 * TIMES}
    with pytest.raises(InputError, match=r"b\.csv.*zero throughout"):
        learner.fit([run_at(1.0, TIMES, stress, name) for name, stress in records.items()])


@pytest.mark.parametrize("rates", [(1.0,), (0.1, 1.0, 3.0)])
def test_a_term_that_is_no_small_change_of_the_known_part_is_found_by_itself(rates):
    # upper-convected Maxwell at Wi = 10 and more stands twice to five times above these records
    moduli, times, mobility = (100.0, 60.0, 20.0), (0.1, 1.0, 10.0), 0.3
    fluid = multimode_giesekus([mobility] * 3, moduli, times)
    runs = start_ups(fluid, rates, np.linspace(0.02, 12.0, 80)).runs
    model = dc.TensorSINDy(base=dc.Fluid(dc.make_law("ucm"), moduli, times)).fit(runs)
    assert [term.term for term in model.terms_] == ["sigma.sigma"]
    # 80 samples at 1 % determine the mobility to about 1 %
    assert model.terms_[0].coefficient == pytest.approx(mobility, rel=0.05)
