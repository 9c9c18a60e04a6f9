"""Runs that no fit saw: a constant that is a little off is excused, a law that is wrong is not."""

import numpy as np
import pytest
from discover.statistics.unseen import Unseen, refutes
from independent import Giesekus, RoliePoly, start_up
from independent.noise import white

from discover.statistics.lack_of_fit import what_is_left
from discover.statistics.residual import Expectation, fast_part

TIMES = np.geomspace(0.05, 10.0, 80)
ALPHA, STEP = 0.3, 1e-3


@pytest.fixture(scope="module")
def responses():
    """σ12 of Giesekus fluids near one another, and of another fluid, in a fast start-up."""
    flow = start_up(3.0)
    made = {a: Giesekus(a, 100.0).respond(flow, TIMES).sigma12 for a in (ALPHA, ALPHA + STEP)}
    made["other"] = RoliePoly(1.0, 0.1, 100.0).respond(flow, TIMES).sigma12
    return made


def unseen(responses, uncertainty, off, extra=0.0, seed=0):
    """Return what a fitted α leaves that is off by so many of its standard deviations."""
    slope = (responses[ALPHA + STEP] - responses[ALPHA]) / STEP
    exact = responses[ALPHA] + extra
    record = white(exact, 0.01, np.random.default_rng(seed))
    predicted = responses[ALPHA] + off * uncertainty * slope
    return Unseen([predicted - record], [record], [(uncertainty * slope)[None]], np.ones(1))


def against(one, expectation=None):
    return refutes(one, [], [], expectation or Expectation())


@pytest.mark.parametrize("uncertainty", [1e-4, 1e-3, 3e-3])
def test_a_constant_within_its_interval_is_no_missing_effect(responses, uncertainty):
    for seed in range(15):
        assert not against(unseen(responses, uncertainty, (-1) ** seed * 1.5, seed=seed))


def test_a_constant_far_outside_its_interval_is_one(responses):
    assert against(unseen(responses, 5e-3, 8.0))


def test_what_stands_out_of_the_noise_is_no_prediction_though_a_constant_would_excuse_it(responses):
    one = unseen(responses, 5e-2, 1.5)
    assert one.moved()[1] > 0.01
    assert against(one)


def test_what_no_constant_makes_up_for_is_one(responses):
    # a fortieth of the way to another fluid, about as large as the noise
    extra = 0.025 * (responses["other"] - responses[ALPHA])
    assert np.sqrt(np.mean(extra**2) / np.mean(responses[ALPHA] ** 2)) < 0.03
    found = [against(unseen(responses, 1e-3, 0.0, extra, seed)) for seed in range(10)]
    assert np.mean(found) >= 0.9


def test_what_is_known_of_noise_and_of_the_linear_data_is_allowed(responses):
    one = unseen(responses, 1e-3, 0.0, 0.025 * (responses["other"] - responses[ALPHA]))
    assert against(one)
    assert not against(one, Expectation(linear_error=0.03))
    assert not against(one, Expectation(noise=0.05))
    # and what repeated runs differ by, as far as it goes
    assert not against(one, Expectation(repeat_error=0.03))
    assert against(one, Expectation(repeat_error=0.003))


def test_a_few_samples_decide_nothing(responses):
    one = unseen(responses, 5e-3, 8.0)
    few = Unseen(
        [one.residuals[0][:6]], [one.records[0][:6]], [one.columns[0][:, :6]], one.correlation
    )
    assert not against(few)


def knocked(one, seed):
    """Return the same with three samples of the record thrown off by half its size."""
    record, residual = one.records[0].copy(), one.residuals[0].copy()
    at = np.random.default_rng(seed).choice(np.arange(5, len(record) - 5), 3, replace=False)
    thrown = 0.5 * np.sqrt(np.mean(record**2))
    record[at] += thrown
    residual[at] -= thrown
    return Unseen([residual], [record], one.columns, one.correlation)


def test_knocks_refute_no_law_once_they_are_left_out(responses):
    right = [knocked(unseen(responses, 1e-3, 0.0, seed=seed), seed) for seed in range(10)]
    left = [one.without_outliers(Expectation()) for one in right]
    assert np.mean([against(one) for one in left]) <= 0.1
    assert all(one.error < 0.013 for one in left)
    assert all(one.error > 0.05 for one in right)


def test_what_is_wrong_is_refuted_without_its_knocks_too(responses):
    extra = 0.025 * (responses["other"] - responses[ALPHA])
    wrong = [knocked(unseen(responses, 1e-3, 0.0, extra, seed), seed) for seed in range(10)]
    found = [against(one.without_outliers(Expectation())) for one in wrong]
    assert np.mean(found) >= 0.9


@pytest.mark.parametrize("seed", [24, 103, 112, 158])
def test_a_misfit_refutes_a_law_though_the_noise_seems_to_be_all_there_is(responses, seed):
    # in these draws what changes from sample to sample seems as large as the misfit beside it
    record = responses[ALPHA]
    size = 0.01 * np.sqrt(np.mean(record**2))
    noise = size * np.random.default_rng(seed).standard_normal(len(record))
    row = noise + 0.9 * size
    assert fast_part(row) > np.sqrt(np.mean(row**2))

    def left(residual, expectation=None):
        return against(Unseen([residual], [record], [np.zeros((0, 80))], np.ones(1)), expectation)

    # a sweep that errs by a tenth of that excuses it no more than one that errs by nothing
    for little in (None, Expectation(linear_error=5e-4)):
        assert left(row, little)
        assert what_is_left([row], [record], little).verdict == "unexplained"
    # the noise alone is none, nor is what a sweep of that error leaves
    assert not left(noise)
    assert what_is_left([noise], [record]).verdict == "explained"
    assert not left(row, Expectation(linear_error=0.01))
    assert what_is_left([row], [record], Expectation(linear_error=0.01)).verdict == "explained"
