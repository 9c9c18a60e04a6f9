"""What no sample tells apart has no narrow interval, and what it does keeps its own."""

import numpy as np
import pytest

from discover.statistics import least_squares_covariance

NOISE = 0.01


def deviations(second):
    """Return the standard deviations of two amplitudes, (SᵀS)⁻¹ and S, with this second column."""
    times = np.linspace(0.0, 5.0, 60)
    columns = np.column_stack([np.sin(times), second(times)])
    residual = NOISE * np.random.default_rng(0).standard_normal(60)
    covariance, inverse, _ = least_squares_covariance(columns, residual, [np.arange(60)])
    return np.sqrt(np.diag(covariance)), inverse, columns


@pytest.mark.parametrize("second", [np.sin, lambda t: 3.0 * np.sin(t), np.zeros_like])
def test_an_amplitude_that_another_cancels_is_open_however_small_the_noise(second):
    found, inverse, _ = deviations(second)
    assert found[1] > 1e2 * NOISE
    # the pseudo-inverse, with which a known parameter is put in, stays finite and small
    assert np.max(np.abs(inverse)) < 1.0


def test_amplitudes_that_differ_keep_the_textbook_deviation():
    found, _, columns = deviations(np.cos)
    expected = NOISE * np.sqrt(np.diag(np.linalg.inv(columns.T @ columns)))
    # the noise is estimated from 60 samples: its size is known to a tenth
    np.testing.assert_allclose(found, expected, rtol=0.3)


def test_what_two_that_cancel_do_together_keeps_its_deviation():
    times = np.linspace(0.0, 5.0, 60)
    columns = np.column_stack([np.sin(times), np.sin(times)])
    residual = NOISE * np.random.default_rng(0).standard_normal(60)
    covariance, *_ = least_squares_covariance(columns, residual, [np.arange(60)])
    alone, *_ = least_squares_covariance(columns[:, :1], residual, [np.arange(60)])
    together = np.ones(2) @ covariance @ np.ones(2)
    # 58 and 59 degrees of freedom
    assert together == pytest.approx(alone[0, 0], rel=0.03)


def test_of_sensitivities_that_run_away_nothing_is_known_and_nothing_crashes():
    # a comparison of blood ended here, in eigenvalues of what is not a number
    columns = np.random.default_rng(0).normal(size=(40, 2))
    residual = np.random.default_rng(1).normal(size=40)
    rows = [np.arange(20), np.arange(20, 40)]
    columns[7, 1] = np.nan
    covariance, inverse, _ = least_squares_covariance(columns, residual, rows)
    assert np.all(np.isinf(covariance))
    assert np.all(np.isinf(inverse))
    columns[7, 1] = 0.0
    covariance, inverse, _ = least_squares_covariance(columns, residual, rows)
    assert np.all(np.isfinite(covariance))


@pytest.mark.parametrize("louder", [1.0, 0.1, 10.0])
def test_an_interval_from_a_short_run_is_that_of_its_own_noise_beside_long_ones(louder):
    """Weighted by one over the root of its samples, as a run is in a fit of the loop."""
    lengths = (24, 400, 400)
    sizes = [1.0 / np.sqrt(n) for n in lengths]
    ends = np.cumsum(lengths)
    sequences = [np.arange(end - n, end) for n, end in zip(lengths, ends, strict=True)]
    columns = np.zeros((ends[-1], 2))
    columns[:24, 0] = sizes[0]  # only the short run sees the first constant
    for rows, size in zip(sequences[1:], sizes[1:], strict=True):
        columns[rows, 1] = size
    noise = [NOISE * size for size in sizes]
    noise[0] *= louder
    rng = np.random.default_rng(0)
    held, widths = 0, []
    for _ in range(200):
        data = np.concatenate(
            [s * rng.standard_normal(n) for s, n in zip(noise, lengths, strict=True)]
        )
        found, *_ = np.linalg.lstsq(columns, data, rcond=None)
        covariance, *_ = least_squares_covariance(
            columns, data - columns @ found, sequences, sizes=sizes
        )
        widths.append(np.sqrt(covariance[0, 0]))
        held += abs(found[0]) < 1.96 * widths[-1]
    # 95 % of 200, less three standard deviations of a binomial number, and what 24 samples leave
    # open of the noise
    assert held > 178
    assert np.median(widths) == pytest.approx(louder * NOISE / np.sqrt(24), rel=0.1)


def test_runs_of_one_length_keep_their_covariance_whatever_the_size_of_their_weights():
    rng = np.random.default_rng(1)
    columns, residual = rng.normal(size=(40, 2)), rng.normal(size=40)
    rows = [np.arange(20), np.arange(20, 40)]
    plain, *_ = least_squares_covariance(columns, residual, rows)
    sized, *_ = least_squares_covariance(columns, residual, rows, sizes=[0.2, 0.2])
    np.testing.assert_allclose(sized, plain, rtol=1e-12)
