"""Likelihood, priors and mixtures are those of textbooks; what runs of one problem differ by."""

from dataclasses import replace
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
from explained import explain
from independent import Giesekus, WhiteMetzner, oscillation, start_up
from independent.noise import correlated, white
from noisy_runs import run_at
from scipy.integrate import quad
from scipy.stats import multivariate_normal, multivariate_t, norm

import discover as dc
from discover.effects import library_term, make_effect
from discover.forward import DeclaredModel
from discover.inference.bands import Predictions, quantiles
from discover.inference.closed_forms import integrated_rate
from discover.inference.fit import Fit
from discover.inference.fits import Fitter
from discover.inference.noise import LEAST, Noise, NoiseModel, deviation
from discover.inference.posterior import Posterior, posterior_of
from discover.inference.priors import Deviations, Prior, Priors
from discover.inference.problem import SCATTER_OF_RUNS, Problem
from discover.inference.rows import Rows
from discover.inference.search import Search
from discover.inference.variables import variables
from discover.statistics import HALF_BAND
from tensor_library.terms import parse_term


def rows_of(counts, lot):
    """Return rows of start-ups of so many samples each, of stresses about one Pa."""
    runs = []
    for number, n in enumerate(counts):
        time = np.linspace(0.1, 5.0, n)
        stress = 1.0 - np.exp(-time) + 0.01 * lot.standard_normal(n)
        runs.append(dc.Run(f"{number}.csv", time, dc.start_up(1.0), np.ones(n), stress))
    return Rows.of(runs)


@pytest.fixture(scope="module")
def rows():
    return rows_of((40, 60), np.random.default_rng(0))


@pytest.mark.parametrize("away", [np.inf, -np.inf, 1e200, -1e13])
def test_a_prediction_that_runs_away_is_no_number_whatever_its_size(rows, away):
    predicted = np.full((2, *rows.seen.shape), 0.7)
    predicted[0, 0, 5:9] = away
    found = rows.flat(predicted)
    assert np.all(np.isnan(found[0, 5:9]))
    # of this trial and of the other all else is as it was, however far off a record
    assert np.all(np.delete(found[0], slice(5, 9)) == 0.7)
    assert np.all(rows.flat(1e9 * predicted)[1] == 0.7e9)
    # what is made of it afterwards is no number, without a word
    with np.errstate(all="raise"):
        assert np.isnan(np.sum(found[0] ** 2) - np.sum(found[0] ** 2))
        assert np.isnan(found[0] @ np.zeros(len(rows)))
    # negative control: as it came it would not be
    with np.errstate(all="raise"), pytest.raises(FloatingPointError):
        np.sum(predicted[0] ** 2 * 1e290) - np.sum(predicted[0] ** 2 * 1e290)


@pytest.mark.parametrize("correlation", [0.0, 0.6])
@pytest.mark.parametrize("share", [0.0, 0.9])
def test_whitening_is_the_density_of_correlated_noise(rows, correlation, share):
    model, lot = NoiseModel(rows), np.random.default_rng(1)
    predicted, residual = 0.5 + lot.random(len(rows)), 0.02 * lot.standard_normal(len(rows))
    noise = Noise(np.array([0.01, 0.03]), 0.02, correlation, share)
    white = model.whitened(residual[:, None], predicted, noise)[:, 0]
    found = model.log_determinant(predicted, noise) - 0.5 * white @ white
    spread = deviation(rows.size, predicted, share) * noise.sizes[rows.run]
    same = rows.run[:, None] == rows.run
    apart = np.abs(np.subtract.outer(np.arange(len(rows)), np.arange(len(rows))))
    covariance = np.outer(spread, spread) * same * correlation**apart
    exact = multivariate_normal(np.zeros(len(rows)), covariance).logpdf(residual)
    constant = 0.5 * len(rows) * np.log(2 * np.pi)
    assert found - constant == pytest.approx(exact, rel=1e-9)  # rounding of a determinant


@pytest.mark.parametrize(("correlation", "about"), [(0.0, 0.0), (0.6, 0.6)])
def test_the_correlation_of_noise_is_told_from_its_residual(correlation, about):
    lot = np.random.default_rng(2)
    rows = rows_of((400, 400), lot)
    sizes = np.repeat([0.01, 0.03], 400) * rows.size
    noise = [correlated(np.ones(400), 1.0, correlation, lot) - 1.0 for _ in range(2)]
    residual = np.concatenate(noise) * sizes
    _, noise = NoiseModel(rows).log_likelihood(residual, rows.recorded)
    assert noise.correlation == about
    # of 400 samples a deviation is told to 3.5 %, of as many as 100 independent ones to 7 %
    np.testing.assert_allclose(noise.sizes, [0.01, 0.03], rtol=0.2)


@pytest.mark.parametrize("size", [0.0, 1e-5])
def test_what_lies_below_the_floor_is_neither_correlated_nor_in_proportion(size):
    lot = np.random.default_rng(4)
    rows = rows_of((400, 400), lot)
    smooth = size * rows.size * np.sin(3.0 * rows.time)  # as an integration errs
    _, noise = NoiseModel(rows).log_likelihood(smooth, rows.recorded)
    assert (noise.correlation, noise.share) == (0.0, 0.0)
    # the size is that of the floor, to which a thirtieth of it adds nothing
    np.testing.assert_allclose(noise.sizes, LEAST, rtol=1e-2)


def test_a_run_left_out_says_nothing(rows):
    lot = np.random.default_rng(3)
    residual = 0.01 * lot.standard_normal(len(rows))
    loud = np.where(rows.run == 1, 50.0 * residual, residual)
    model = NoiseModel(rows, without=1)
    both = [model.log_likelihood(one, rows.recorded)[0] for one in (residual, loud)]
    assert both[0] == both[1]
    whole = NoiseModel(rows)
    assert whole.log_likelihood(residual, rows.recorded)[0] != pytest.approx(
        whole.log_likelihood(loud, rows.recorded)[0]
    )


def test_what_runs_away_has_no_likelihood(rows):
    residual = np.full(len(rows), np.nan)
    assert NoiseModel(rows).log_likelihood(residual, rows.recorded)[0] == -np.inf


PRIORS = [
    Prior("normal", 1.0, 0.5),
    Prior("normal", 0.0, 0.5, low=0.0),
    Prior("amplitude", 0.0, 0.2, low=0.0, high=np.inf),
    Prior("amplitude", 0.0, 0.2),
    Prior("logarithm", 2.0, 1.5),
]


@pytest.mark.parametrize("prior", PRIORS)
def test_a_prior_is_a_density_of_its_coordinate(prior):
    low = prior.centre if prior.low == prior.centre and not prior.is_logarithm else -np.inf
    whole, _ = quad(lambda x: np.exp(Priors({0: prior}).log_density(np.array([x]))), low, np.inf)
    assert whole == pytest.approx(1.0, abs=1e-6)  # of the quadrature


@pytest.mark.parametrize("prior", PRIORS)
@pytest.mark.parametrize("coordinate", [0.05, 0.7, 3.0])
def test_the_pull_of_a_prior_is_its_slope(prior, coordinate):
    step = 1e-6
    ends = [
        Priors({0: prior}).log_density(np.array([coordinate + sign * step])) for sign in (1, -1)
    ]
    ((slope, curvature),) = Priors({0: prior}).pulls(np.array([coordinate]))
    assert slope == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-6, abs=1e-8)
    assert curvature > 0.0


def test_quantiles_of_a_mixture_are_those_of_its_draws():
    weights, middle, deviation = np.array([3.0, 1.0]), np.array([0.0, 4.0]), np.array([1.0, 0.5])
    lot = np.random.default_rng(4)
    chosen = lot.choice(2, 400_000, p=weights / 4.0)
    drawn = lot.normal(middle[chosen], deviation[chosen])
    found = quantiles(weights, middle[:, None], deviation[:, None] ** 2, (0.025, 0.5, 0.975))
    # the standard error of a quantile of so many draws is below 0.005
    np.testing.assert_allclose(np.ravel(found), np.quantile(drawn, (0.025, 0.5, 0.975)), atol=0.02)
    one = quantiles(np.ones(1), np.zeros((1, 1)), np.ones((1, 1)), (0.975,))
    assert one[0][0] == pytest.approx(norm.ppf(0.975), abs=1e-9)


def test_many_starts_of_one_set_leave_another_set_in_the_race():
    def fit(name, log_posterior):
        return Mock(Fit, names=(name,), log_posterior=log_posterior)

    many, other = [fit("a", 100.0 - i) for i in range(5)], fit("b", 40.0)

    def given_up(wanted):
        return id(other) in Fitter.hopeless([*many, other], [other], [0.5], wanted)

    # of two sets the second best stays, though four starts of the first are ahead of it
    assert not given_up(wanted=2)
    assert given_up(wanted=1)  # 60 behind, half a nat a round


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


@pytest.mark.parametrize("wider", [1.0, 1e3], ids=["as the runs tell", "a thousandfold"])
def test_a_band_is_no_wider_than_fitted_runs_allow_whatever_a_posterior_says(wider):
    declared = DeclaredModel.maxwell([1.0], [1.0], fit_modulus=True, fit_relaxation_time=True)
    problem = Problem(declared, [], start_ups(np.zeros(len(RATES))))
    posterior = explain(problem)
    (fit, _), *_ = posterior.fits
    # a Laplace posterior that is too wide stands for a constant that is flat where it is likeliest
    wide = replace(fit, covariance=wider**2 * fit.covariance, memory={})
    posterior = replace(posterior, fits=((wide, 1.0),), unexplained=0.0)
    bands = Predictions(posterior, problem.fitted).bands(posterior.fits)
    half, held = [], []
    for rate, band in zip(RATES, bands, strict=True):
        truth = rate * (1.0 - np.exp(-TIMES))  # start-up of a Maxwell fluid of 1 Pa and 1 s
        half.append(0.5 * (band.high - band.low)[:, 0] / (NOISE * np.sqrt(np.mean(truth**2))))
        held.append((band.low[:, 0] <= truth) & (truth <= band.high[:, 0]))
    # each direction may change all samples together by one of their noise, their root of squares;
    # a tenth for the curvature of the law along it
    most = HALF_BAND * np.sqrt(len(fit.covariance) / np.size(half))
    assert 0.3 * most < np.sqrt(np.mean(np.square(half))) < 1.1 * most
    assert np.mean(held) > 0.9


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


def test_a_single_run_is_missed_by_what_its_own_fit_leaves_and_of_two_each_without_it(monkeypatch):
    fit = object.__new__(Fit)
    fit.memory, fit.noise = {}, Noise(np.ones(1), 0.03, 0.0, 0.0)
    fitter = SimpleNamespace(rows=SimpleNamespace(runs=["alone"]), misfit=lambda fit: 0.05)
    found = SimpleNamespace(fitter_of=lambda fit: fitter)
    without = [np.array([0.034, 0.05])]
    monkeypatch.setattr("discover.inference.posterior.left_out", lambda *asked: without)
    assert Posterior.missed(found, fit) == pytest.approx([0.04])  # 0.05² = 0.03² + 0.04²
    fitter.rows.runs.append("another")
    fit.memory.clear()
    assert Posterior.missed(found, fit) == pytest.approx([0.016, 0.04])
