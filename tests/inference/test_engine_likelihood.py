"""Likelihood, priors and mixtures are those of textbooks, by scipy; and what a search gives up."""

from unittest.mock import Mock

import numpy as np
import pytest
from independent.noise import correlated
from scipy.integrate import quad
from scipy.stats import multivariate_normal, norm

import discover as dc
from discover.inference.engine.bands import quantiles
from discover.inference.engine.fit import Fit
from discover.inference.engine.fits import Fitter
from discover.inference.engine.noise import LEAST, Noise, NoiseModel
from discover.inference.engine.priors import Prior, Priors
from discover.inference.engine.rows import Rows
from discover.protocols import start_up


def rows_of(counts, lot):
    """Return rows of start-ups of so many samples each, of stresses about one Pa."""
    runs = []
    for number, n in enumerate(counts):
        time = np.linspace(0.1, 5.0, n)
        stress = 1.0 - np.exp(-time) + 0.01 * lot.standard_normal(n)
        runs.append(dc.Run(f"{number}.csv", time, start_up(1.0), np.ones(n), stress))
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
    deviation = model.deviation(predicted, share) * noise.sizes[rows.run]
    same = rows.run[:, None] == rows.run
    apart = np.abs(np.subtract.outer(np.arange(len(rows)), np.arange(len(rows))))
    covariance = np.outer(deviation, deviation) * same * correlation**apart
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
