"""How far zero, drift and gain of runs differ: told by them, on closed forms of one mode."""

import numpy as np
import pytest
from independent.noise import white
from noisy_runs import run_at
from scipy.stats import multivariate_normal, multivariate_t

from discover.forward import DeclaredModel
from discover.inference.engine import explain
from discover.inference.engine.fits import Fitter
from discover.inference.engine.priors import Deviations
from discover.inference.engine.problem import SCATTER_OF_RUNS, Problem

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
    (band,) = posterior.bands(posterior.problem.predicted)
    truth = 1.1 * (1.0 - np.exp(-TIMES))
    assert least * zero < np.mean(band.middle[:, 0] - truth) < most * zero
