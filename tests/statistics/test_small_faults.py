"""Intervals that allow for small faults of reading: a fluid by scipy."""

import numpy as np
import pytest
from discover.statistics.reading.reading_faults import Reading
from discover.statistics.reading.small_faults import WIDTHS, small_faults
from independent import Giesekus, oscillation, start_up

GROWTH, WAVE = np.linspace(0.1, 8.0, 80), np.linspace(0.1, 12.0, 120)
FLOWS = {
    "slow": (start_up(0.5), GROWTH),
    "fast": (start_up(2.0), GROWTH),
    "wave": (oscillation(2.0, 1.0), WAVE),
}
DRAWS = 40


def rms(values):
    return np.sqrt(np.mean(values**2))


@pytest.fixture(scope="module")
def told():
    """σ12 of a mobility of 0.3, and how it changes with it."""
    at, up = (
        {n: Giesekus(alpha, 100.0).respond(*f).sigma12 for n, f in FLOWS.items()}
        for alpha in (0.3, 0.301)
    )
    return {name: (at[name], (up[name] - at[name]) / 1e-3) for name in FLOWS}


def fitted(told, fault, lot, noise=0.01):
    """Return runs that a fault changed, and the error and half-interval of the fitted mobility."""
    records = {}
    for name, (stress, _) in told.items():
        read = fault(name, FLOWS[name][1], stress, lot)
        records[name] = read + noise * rms(read) * lot.standard_normal(len(read))
    slope = np.concatenate([told[n][1] / rms(records[n]) for n in told])
    off = np.concatenate([(records[n] - told[n][0]) / rms(records[n]) for n in told])
    error = float(slope @ off / (slope @ slope))
    half = 1.96 * np.std(off - error * slope) / np.linalg.norm(slope)
    runs = []
    for name, (stress, column) in told.items():
        predicted = stress + error * column
        residual = predicted - records[name]
        runs.append(Reading(FLOWS[name][1], predicted, residual, column[None]))
    return runs, error, float(half)


def exact(name, time, stress, lot):
    return stress


FAULTS = {
    "range": lambda name, t, s, lot: s * (1 + 0.005 * (np.abs(s) > 50.0)),
    "factor": lambda name, t, s, lot: s * (1 + 0.005 * lot.standard_normal()),
    "zero": lambda name, t, s, lot: s + 0.01 * rms(s) * lot.standard_normal(),
    "growth": lambda name, t, s, lot: s * (1 + 0.01 * lot.standard_normal() * t / t[-1]),
}


@pytest.mark.parametrize(
    "kind",
    [
        "factor",
        pytest.param("zero", marks=pytest.mark.slow),
        pytest.param("range", marks=pytest.mark.slow),
        pytest.param("growth", marks=pytest.mark.slow),
    ],
)
def test_intervals_hold_behind_a_fault_that_no_test_sees(told, kind):
    by_noise = allowing = 0
    for seed in range(DRAWS):
        runs, error, half = fitted(told, FAULTS[kind], np.random.default_rng([seed, 3]))
        low, high = small_faults(runs).holding(0, error, error - half, error + half)
        by_noise += abs(error) <= half
        allowing += low <= 0.0 <= high
    # a share of 0.95 of 40 draws is 34 or more in 98 of 100
    assert allowing >= 34
    assert by_noise < 26


def test_an_exact_instrument_costs_a_few_widths_and_no_more(told):
    """They are 1.65 % of the mobility, and 0.55 % for noise alone."""
    for seed in range(5):
        runs, error, half = fitted(told, exact, np.random.default_rng([seed, 4]))
        low, high = small_faults(runs).holding(0, error, error - half, error + half)
        assert low <= 0.0 <= high
        assert 1.5 < (high - low) / (2 * half) < 4.5


def test_quiet_records_tell_the_faults_apart_from_the_law(told):
    """So intervals follow the noise, and do not stay at what the faults may be."""
    loud, quiet = (
        small_faults(fitted(told, exact, np.random.default_rng(5), noise)[0]).covariance[0, 0]
        for noise in (1e-2, 1e-4)
    )
    assert np.sqrt(quiet) < 0.05 * np.sqrt(loud)


def test_a_modulus_is_known_no_better_than_its_run_is_read(told):
    stress, _ = told["slow"]
    noise = 1e-4 * rms(stress) * np.random.default_rng(6).standard_normal(len(stress))
    # a change of its logarithm is a factor on the run, and no sample can tell them apart
    run = Reading(GROWTH, stress, noise, stress[None])
    deviation = np.sqrt(small_faults([run]).covariance[0, 0])
    assert 0.95 * WIDTHS[0] < deviation < WIDTHS[-1]


def test_what_no_constant_was_fitted_to_needs_no_allowance(told):
    runs, _, _ = fitted(told, exact, np.random.default_rng(8))
    none = [Reading(r.times, r.predicted, r.residual, r.columns[:0]) for r in runs]
    assert small_faults(none) is None
    assert small_faults([]) is None


def test_repeats_that_differ_by_more_than_an_instrument_widen_what_is_allowed_for(told):
    stress, _ = told["slow"]
    noise = 0.01 * rms(stress) * np.random.default_rng(6).standard_normal(len(stress))
    run = Reading(GROWTH, stress, noise, stress[None])
    alone, alike, apart = (
        np.sqrt(small_faults([run], loading).covariance[0, 0]) for loading in (0.0, 0.004, 0.08)
    )
    assert alike == alone
    assert apart > 5.0 * alone
