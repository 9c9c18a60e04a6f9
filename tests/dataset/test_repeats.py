"""Repeated tests and copies of one record; records by scipy, and in closed form."""

from dataclasses import replace

import numpy as np
import pytest
from independent import Giesekus, oscillation, start_up

import discover as dc
from discover.dataset import Run
from discover.dataset.records.repeats import (
    count_flows,
    is_copy,
    repeated_tests,
    require_no_copies,
)
from discover.errors import InputError

TIMES = np.linspace(0.05, 8.0, 60)


def record(name, rate=2.0, factor=1.0, noise=0.0, seed=0, times=TIMES, **metadata):
    exact = factor * Giesekus(0.3).respond(start_up(rate), times).sigma12
    off = (
        noise * np.sqrt(np.mean(exact**2)) * np.random.default_rng(seed).standard_normal(len(times))
    )
    rates = np.full(len(times), rate)
    return dc.Run(name, times, dc.start_up(rate), rates, exact + off, metadata=metadata)


def test_a_repeated_test_is_told_whatever_its_loading_noise_and_times():
    other = record("b", factor=0.97, noise=0.02, times=TIMES[:-1] + 0.05)
    runs = [record("a", factor=1.03), other, record("c", 5.0)]
    assert repeated_tests(runs) == (("a", "b"),)


@pytest.mark.parametrize(
    "other",
    [{"rate": 2.1}, {"temperature_C": 170.0}, {"times": TIMES[:5]}, {"gap_mm": 1.0}],
    ids=["rate", "temperature", "few samples", "a condition of one alone"],
)
def test_another_test_is_no_repeat(other):
    first = record("a", temperature_C=160.0)
    second = record("b", **{"temperature_C": 160.0, **other})
    assert repeated_tests([first, second]) == ()


def test_another_history_is_no_repeat_and_a_count_of_the_source_is_no_condition():
    first = record("a", n_points=60.0)
    assert repeated_tests([first, record("b", n_points=400.0)]) == (("a", "b"),)
    assert repeated_tests([first, replace(record("b"), strain_before=10.0)]) == ()
    assert repeated_tests([]) == ()


def waving(name, times):
    rates = 2.0 * np.cos(times)
    stress = Giesekus(0.3).respond(oscillation(2.0, 1.0), times).sigma12
    return dc.Run(name, times, dc.protocols.oscillatory_shear(2.0, 1.0), rates, stress)


def test_runs_that_only_begin_alike_are_no_repeat():
    # a start-up whose times were told in minutes ends before the wave has left its first rate
    short = replace(record("a"), time=TIMES / 60.0)
    assert repeated_tests([short, waving("wave", TIMES)]) == ()
    assert count_flows([short, waving("wave", TIMES)]) == 2


def test_a_run_that_ends_early_is_the_same_flow():
    early = record("b", factor=1.03, times=np.linspace(0.05, 1.0, 20))
    assert repeated_tests([record("a"), early]) == (("a", "b"),)


COPIED = np.linspace(0.1, 8.0, 80)


def run(name, stress, times=COPIED, rate=2.0):
    return Run(name, times, dc.start_up(rate), np.full(len(times), rate), stress)


def grown(seed, rate=2.0, times=COPIED):
    """A start-up with 1 % of noise, of a fluid of 100 Pa and 1 s."""
    exact = 100.0 * rate * -np.expm1(-times)
    noise = np.random.default_rng(seed).standard_normal(len(times))
    return exact + 0.01 * np.sqrt(np.mean(exact**2)) * noise


def rounded(stress, digits):
    return np.array([float(f"{value:.{digits}g}") for value in stress])


def test_a_record_is_a_copy_whatever_its_name_digits_and_samples():
    first = run("a.csv", grown(0))
    assert is_copy(first, run("b.csv", grown(0)))
    assert is_copy(first, run("b.csv", rounded(grown(0), 4)))
    assert is_copy(first, run("b.csv", grown(0)[::3], COPIED[::3]))
    assert is_copy(run("b.csv", grown(0), rate=2.2), first)  # told at another rate


def test_a_second_measurement_is_none():
    first = run("a.csv", grown(0))
    assert not is_copy(first, run("b.csv", grown(1)))
    assert not is_copy(first, run("b.csv", grown(1)[::3], COPIED[::3]))
    assert not is_copy(first, run("b.csv", grown(0, 2.1), rate=2.1))


def test_exact_records_of_two_rates_are_none():
    exact = {rate: 100.0 * rate * -np.expm1(-COPIED) for rate in (2.0, 2.001)}
    assert not is_copy(*(run(str(r), stress, rate=r) for r, stress in exact.items()))


def test_a_record_that_is_fitted_judges_nothing():
    first, again, other = run("a.csv", grown(0)), run("b.csv", grown(0)), run("c.csv", grown(1))
    with pytest.raises(InputError, match=r"held-out run 'b.csv'.*'a.csv'.*proves nothing"):
        require_no_copies([first, other], [again])
    require_no_copies([first], [other])
