"""Intervals: they cover as often as they claim, also where the noise remembers."""

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import t as student

from discover.learners.tensor_sindy.intervals import (
    ParameterUncertainty,
    least_squares_covariance,
)
from discover.statistics import noise_model

N_RUNS, N_SAMPLES, N_SETS = 6, 120, 400
SEQUENCES = list(np.arange(N_RUNS * N_SAMPLES).reshape(N_RUNS, N_SAMPLES))


def autoregressive(rng, correlation, sizes=(1.0,) * N_RUNS):
    start = 200  # forgets how it began
    rows = [
        size * lfilter([1.0], [1.0, -correlation], rng.normal(size=start + N_SAMPLES))[start:]
        for size in sizes
    ]
    return np.concatenate(rows)


def design():
    """Slow signatures, as a stress has; slow noise imitates them."""
    phase = np.linspace(0.0, 4.0 * np.pi, N_SAMPLES)
    columns = [np.column_stack([np.sin(phase + i), np.cos(2.0 * phase + i)]) for i in range(N_RUNS)]
    return np.concatenate(columns)


def coverage(correlation, sizes=(1.0,) * N_RUNS):
    rng, columns = np.random.default_rng(0), design()
    truth, covered = np.array([1.0, -0.5]), 0
    for _ in range(N_SETS):
        data = columns @ truth + autoregressive(rng, correlation, sizes)
        found, *_ = np.linalg.lstsq(columns, data, rcond=None)
        covariance, _, noise = least_squares_covariance(columns, data - columns @ found, SEQUENCES)
        factor = student.ppf(0.975, noise.effective_samples - 2)
        covered += np.sum(np.abs(found - truth) < factor * np.sqrt(np.diag(covariance)))
    return covered / (2 * N_SETS)


@pytest.mark.parametrize("correlation", [0.0, pytest.param(0.6, marks=pytest.mark.slow), 0.9])
def test_intervals_cover_as_often_as_they_claim(correlation):
    # 800 trials at 95 % have a standard deviation of 0.8 %; three of them, and the band
    assert 0.925 <= coverage(correlation) <= 0.98


def test_intervals_cover_where_runs_differ_in_noise():
    assert 0.925 <= coverage(0.6, sizes=(0.2, 0.5, 1.0, 1.0, 2.0, 5.0)) <= 0.98


def test_white_intervals_would_cover_far_too_seldom_on_slow_noise():
    """The negative control: what the autoregressive model is there for."""
    rng, columns = np.random.default_rng(0), design()
    covered = 0
    for _ in range(100):
        data = autoregressive(rng, 0.9)
        found, *_ = np.linalg.lstsq(columns, data, rcond=None)
        residual = data - columns @ found
        error = np.sqrt(np.diag(np.linalg.inv(columns.T @ columns)) * np.var(residual))
        covered += np.sum(np.abs(found) < 1.96 * error)
    assert covered / 200 < 0.75


def test_white_noise_is_found_white_and_slow_noise_slow():
    rng = np.random.default_rng(1)
    white = [rng.normal(size=400) for _ in range(4)]
    model = noise_model(white)
    assert model.coefficients.size == 0
    assert model.effective_samples == 1600
    slow = [autoregressive(rng, 0.9)[:N_SAMPLES] for _ in range(12)]
    model = noise_model(slow)
    # an AR(1) process has (1 − φ)/(1 + φ) = 1/19 as many independent samples; its estimate from
    # 1,440 samples has a standard error of about a quarter of that
    assert model.effective_samples == pytest.approx(1440 / 19, rel=0.6)
    assert model.correlation[1] == pytest.approx(0.9, abs=0.05)


def test_the_covariance_of_noise_is_that_of_its_process():
    rng = np.random.default_rng(2)
    model = noise_model([autoregressive(rng, 0.5)])
    dense = model.covariance_times(0, np.eye(50))
    lags = np.abs(np.subtract.outer(np.arange(50), np.arange(50)))
    expected = model.variance[0] * model.correlation[lags]
    np.testing.assert_allclose(dense, expected, rtol=1e-9, atol=1e-12)


def test_a_perfect_fit_has_no_noise_and_no_error():
    model = noise_model([np.zeros(40), np.zeros(10)])
    assert model.coefficients.size == 0
    assert np.all(model.variance == 0.0)


def test_a_known_parameter_gives_the_least_squares_fit_to_the_others():
    rng = np.random.default_rng(3)
    design = rng.normal(size=(80, 3)) @ np.array([[1.0, 0.9, 0.2], [0.0, 0.3, 0.1], [0.0, 0.0, 1]])
    target = design @ [1.0, 0.4, -0.2] + 0.1 * rng.normal(size=80)
    values, *_ = np.linalg.lstsq(design, target, rcond=None)
    covariance, inverse, noise = least_squares_covariance(
        design, target - design @ values, [np.arange(80)]
    )
    free = ParameterUncertainty(covariance, inverse, (), np.zeros(3), 2.0, noise)
    known, half = free.given(values, 0, 1.0)
    others, *_ = np.linalg.lstsq(design[:, 1:], target - design[:, 0], rcond=None)
    # the same least-squares problem solved twice: rounding only
    np.testing.assert_allclose(known, [1.0, *others], rtol=1e-10)
    alone, *_ = least_squares_covariance(design[:, 1:], target - design @ values, [np.arange(80)])
    # the same noise: the two differ in its degrees of freedom, 77 and 78
    np.testing.assert_allclose(half, [0.0, *(2.0 * np.sqrt(np.diag(alone)))], rtol=0.02, atol=1e-12)
    assert half[1] < 0.5 * free.half_widths[1]
