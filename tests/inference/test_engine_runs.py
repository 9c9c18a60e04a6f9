"""Runs of one problem: how far they differ, what one of them passes for, and their strains."""

import numpy as np
import pytest
from independent import Giesekus, WhiteMetzner, oscillation, start_up
from independent.noise import white
from noisy_runs import run_at
from scipy.stats import multivariate_normal, multivariate_t

import discover as dc
from discover.effects import library_term, make_effect
from discover.forward import DeclaredModel
from discover.inference.engine import explain
from discover.inference.engine.closed_forms import integrated_rate
from discover.inference.engine.fits import Fitter
from discover.inference.engine.posterior import posterior_of
from discover.inference.engine.priors import Deviations
from discover.inference.engine.problem import SCATTER_OF_RUNS, Problem
from discover.inference.engine.search import Search
from discover.inference.engine.variables import variables
from tensor_library.terms import parse_term

RATES, NOISE = (0.3, 0.6, 1.0, 1.5, 2.0), 0.002
TIMES = np.linspace(0.05, 8.0, 160)


def start_ups(off, rates=RATES):
    """Return start-ups of a Maxwell fluid of 1 Pa and 1 s, each with a zero of its own in Pa."""
    lot, runs = np.random.default_rng(3), []
    for rate, zero in zip(rates, off, strict=True):
        stress = white(rate * (1.0 - np.exp(-TIMES)), NOISE, lot) + zero
        runs.append(run_at(rate, TIMES, stress, f"{rate:g}.csv"))
    return runs


def width_of_zeros(off):
    problem = Problem(DeclaredModel.maxwell([1.0], [1.0]), [], start_ups(off))
    fitter = Fitter(problem, problem.fitted)
    (fit,) = fitter.fit([fitter.start((), problem.zero)])
    return fitter.errors.widths(fit.linear)[fitter.errors.of_runs.start]


def test_deviations_of_unknown_size_have_students_density_and_runs_off_by_zeros_say_so():
    values = np.array([0.3, -1.2, 2.5])
    student = multivariate_t(np.zeros(3), 0.7**2 * np.eye(3), df=2.0).logpdf(values)
    assert Deviations(0.7, 2.0).log_density(values) == pytest.approx(student, rel=1e-12)
    normal = multivariate_normal(np.zeros(3), 0.7**2 * np.eye(3)).logpdf(values)
    assert Deviations(0.7).log_density(values) == pytest.approx(normal, rel=1e-12)
    # each zero is known to the noise over the root of the samples, 0.02 %
    assert width_of_zeros(np.zeros(len(RATES))) < 1.5 * SCATTER_OF_RUNS
    off = 0.01 * np.array([1.0, -1.0, 0.7, -1.3, 0.6]) * RATES
    # drifts, which are as usual, are counted with them
    assert 3.0 * SCATTER_OF_RUNS < width_of_zeros(off) < 10.0 * SCATTER_OF_RUNS


@pytest.mark.parametrize(
    ("signs", "least", "most"),
    # of three zeros that are one, and may as well be three, the next has three quarters
    [((1, 1, 1), 0.6, 0.9), ((1, -1, 0), -0.2, 0.2), ((0, 0, 0), -0.1, 0.1)],
    ids=["as one", "each another", "none"],
)
def test_a_zero_that_runs_have_in_common_is_expected_of_the_next_one_too(signs, least, most):
    zero, rates = 0.01, (0.8, 1.0, 1.2)
    (ahead,) = start_ups([0.0], (1.1,))
    fitted = start_ups(zero * np.array(signs, float), rates)
    posterior = explain(Problem(DeclaredModel.maxwell([1.0], [1.0]), [], fitted, [ahead]))
    (band,) = posterior.bands()
    truth = 1.1 * (1.0 - np.exp(-TIMES))
    assert least * zero < np.mean(band.middle[:, 0] - truth) < most * zero


SCALE = {"modulus": 100.0, "relaxation_time": 1.0}
FLOWS = (
    (start_up(0.5), dc.start_up(0.5), np.linspace(0.1, 8.0, 80)),
    (start_up(2.0), dc.start_up(2.0), np.linspace(0.1, 8.0, 80)),
    (oscillation(2.0, 1.0), dc.oscillatory_shear(2.0, 1.0), np.linspace(0.1, 12.0, 120)),
)
TERMS = ("tr(sigma.gammadot)*sigma", "tr(sigma.gammadot.gammadot)*sigma")
STARTS = {"wall_slip": 0.006, TERMS[0]: 0.5, TERMS[1]: -0.17, "giesekus_mobility": 0.3}


def left_by(fluid, names, seed):
    """Return what some effects, fitted to a fluid by scipy with 1 % noise, leave, and a verdict."""
    runs = []
    for i, (flow, protocol, times) in enumerate(FLOWS):
        stress = fluid.respond(flow, times).sigma12
        noisy = white(stress, 0.01, np.random.default_rng([seed, i]))
        rates = np.asarray(flow.rate(times), dtype=float)
        runs.append(dc.Run(f"run_{i}", times, protocol, rates, noisy))
    effects = [make_effect("wall_slip"), make_effect("giesekus_mobility")]
    effects += [library_term(parse_term(term)) for term in TERMS]
    problem = Problem(DeclaredModel.maxwell([100.0], [1.0]), effects, runs, computed=True)
    start = problem.zero.copy()
    for name in names:
        start[problem.model.positions(name)[0]] = STARTS[name]
    fitter = Fitter(problem, problem.fitted)
    search = Search(fitter)
    (fit,) = search.add([fitter.start(names, start)])
    return fitter.misfit(fit), posterior_of(search).verdict


def test_slip_and_two_terms_do_not_explain_a_white_metzner_fluid():
    found = [left_by(WhiteMetzner(0.5, **SCALE), ("wall_slip", *TERMS), seed) for seed in range(4)]
    assert max(misfit for misfit, _ in found) < 0.017  # hardly more than the noise
    assert sum(verdict == "unexplained" for _, verdict in found) >= 3


@pytest.mark.parametrize("seed", range(4))
def test_the_law_that_made_the_runs_explains_them(seed):
    _, verdict = left_by(Giesekus(0.3, **SCALE), ("giesekus_mobility",), seed)
    assert verdict == "effects_added"


STRAINED = np.linspace(0.1, 4.0, 40)


def run_after(step: float, rate: float, duration: float = 0.0) -> dc.Run:
    flow = dc.after_step_strain(
        dc.start_up(rate), step, first=float(STRAINED[0]), duration=duration
    )
    stress = step * np.exp(-STRAINED)
    return dc.Run(f"{step:g}", STRAINED, flow, np.full(len(STRAINED), rate), stress)


@pytest.mark.parametrize("duration", [0.0, 0.2])
def test_a_step_of_strain_before_the_record_counts_as_strain(duration):
    # in closed form: the step, and a constant rate times time from then on
    np.testing.assert_allclose(integrated_rate(run_after(2.0, 3.0, duration)), 2.0 + 3.0 * STRAINED)


def test_a_steady_flow_before_a_record_adds_no_strain_and_every_variable_is_a_number():
    flow = dc.after_steady_flow(dc.start_up(0.0), rate=5.0, end=4.0)
    one = dc.Run("a", STRAINED, flow, np.zeros(len(STRAINED)), np.exp(-STRAINED), rate_before=5.0)
    np.testing.assert_array_equal(integrated_rate(one), 0.0)
    problem = Problem(
        DeclaredModel.maxwell([1.0], [1.0]), [], [run_after(0.5, 0.0), run_after(2.0, 0.0)]
    )
    found = {one.slot: one for one in variables(problem.fitted)}
    assert found["network"].largest == 2.0
    for one in found.values():
        columns = one.columns(problem.fitted.recorded)
        assert np.all(np.isfinite(columns))
