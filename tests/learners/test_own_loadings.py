"""Learners on runs with a factor of its own on each record, by scipy and by closed forms."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from independent import Giesekus, start_up
from scipy.optimize import minimize_scalar

import discover as dc
from discover.dataset import Run
from discover.dataset.run import Loading
from discover.forward import make_records
from discover.forward.records import Loadings
from discover.learners.tbnn_ude.problem import make_problem as network_problem
from discover.protocols import start_up as protocol
from tensor_library.library import build_library

TIMES = np.linspace(0.1, 8.0, 60)
FACTORS = {0.5: 1.03, 1.0: 0.98, 2.0: 0.965, 3.0: 1.02}
MOBILITY = 0.3


OWN = Loading(0.03)


def runs_of(factors, noise=0.01, loading: Loading | None = OWN):
    lot, found = np.random.default_rng(11), []
    for rate, factor in factors.items():
        exact = Giesekus(MOBILITY, 100.0).respond(start_up(rate), TIMES).sigma12
        error = noise * np.sqrt(np.mean(exact**2)) * lot.standard_normal(len(TIMES))
        rates = np.full(len(TIMES), rate)
        own = factor * exact + error
        found.append(Run(f"{rate:g}.csv", TIMES, protocol(rate), rates, own, loading=loading))
    return found


def test_what_is_left_is_the_least_over_all_factors_that_the_prior_allows():
    lot = np.random.default_rng(1)
    predicted = 5.0 + lot.standard_normal(40)
    recorded = 1.06 * predicted + 0.2 * lot.standard_normal(40)
    noise, deviation = 0.2, 0.03
    one = Loadings(np.ones((1, 1), bool), np.asarray(deviation), np.asarray([noise]))
    told = one.whitened((predicted - recorded)[None], predicted[None])

    def penalised(f):
        off = ((1.0 + f) * predicted - recorded) / noise
        return float(off @ off) + f**2 / deviation**2

    best = minimize_scalar(penalised, bracket=(-0.1, 0.1)).fun
    left = float(np.sum(np.asarray(told) ** 2)) / noise**2
    assert left == pytest.approx(best, rel=1e-9)
    # without a factor far more is left
    assert np.sum(((predicted - recorded) / noise) ** 2) > 2.0 * left


def test_runs_of_one_loading_have_no_factor():
    assert make_records(runs_of(FACTORS, loading=None), len(TIMES), "run").loadings is None
    some = [replace(runs_of({0.5: 1.0})[0], loading=None), *runs_of({1.0: 1.0})]
    records = make_records(some, len(TIMES), "run").of_one_kind()
    left = records.residual(1.01 * records.recorded)
    whole = replace(records, loadings=None).residual(1.01 * records.recorded)
    assert left[0] == pytest.approx(whole[0], abs=1e-15)
    assert np.sum(left[1] ** 2) < 0.5 * np.sum(whole[1] ** 2)


@pytest.mark.slow
def test_sparse_regression_holds_the_mobility_whatever_the_loadings():
    found = dc.TensorSINDy(build_library(), modulus=100.0).fit(runs_of(FACTORS)).result_
    assert [term.term for term in found.terms] == ["sigma.sigma"]
    low, high = found.terms[0].ci95
    assert low < MOBILITY < high
    assert high - low < 0.04  # some 5 % of a mobility, as beside exact loadings and 1 % of noise


@pytest.mark.slow
def test_sparse_regression_takes_factors_for_a_law_where_all_are_one_loading():
    found = (
        dc.TensorSINDy(build_library(), modulus=100.0).fit(runs_of(FACTORS, loading=None)).result_
    )
    told = [term for term in found.terms if term.term == "sigma.sigma"]
    held = bool(told) and told[0].ci95[0] < MOBILITY < told[0].ci95[1]
    assert len(found.terms) > 1 or not held


def test_a_network_sees_no_misfit_in_the_factor_of_a_loading():
    def left(loading):
        runs = runs_of({0.5: 1.03, 2.0: 0.97}, noise=0.0, loading=loading)
        problem = network_problem(runs, np.array([100.0]), np.array([1.0]))
        exact = [runs[0].stress / 1.03, runs[1].stress / 0.97]
        return float(jnp.linalg.norm(problem.records.residual(jnp.asarray(np.stack(exact)))))

    unaware = left(None)
    assert unaware == pytest.approx(0.03, rel=0.05)
    # what is left is what the prior holds back: 3 % to a noise of 0.1 %
    assert left(OWN) < 0.01 * unaware


@pytest.mark.slow
def test_derivatives_of_a_network_are_those_with_the_factors_let_go():
    records = network_problem(runs_of(FACTORS), np.array([100.0]), np.array([1.0])).records
    change = jax.random.normal(jax.random.key(0), (*records.recorded.shape, 1))
    predicted = 1.01 * records.recorded
    ends = [records.residual(predicted + s * 1e-4 * change[..., 0]) for s in (1.0, -1.0)]
    slope = np.asarray(ends[0] - ends[1]) / 2e-4
    told = np.asarray(records.linearised(predicted, change)[1])[..., 0]
    assert told == pytest.approx(slope, abs=1e-9)
    held = np.asarray(records.weight * change[..., 0])
    assert np.max(np.abs(told - held)) > 0.01 * np.max(np.abs(held))
