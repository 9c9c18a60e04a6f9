"""Repeated tests and copies of one record; records by scipy, and in closed form."""

from dataclasses import replace

import numpy as np
import pytest
from independent import Giesekus, oscillation, start_up
from independent.noise import white

import discover as dc
from discover.dataset.records.repeats import count_flows, is_copy, repeated_tests, require_no_copies
from discover.errors import InputError

TIMES = np.linspace(0.05, 8.0, 60)


def record(name, rate=2.0, factor=1.0, noise=0.0, seed=0, times=TIMES, **metadata):
    exact = factor * Giesekus(0.3).respond(start_up(rate), times).sigma12
    stress = white(exact, noise, np.random.default_rng(seed))
    rates = np.full(len(times), rate)
    return dc.Run(name, times, dc.start_up(rate), rates, stress, metadata=metadata)


def test_a_repeated_test_is_told_whatever_its_loading_noise_and_end_and_another_history_is_none():
    other = record("b", factor=0.97, noise=0.02, times=TIMES[:-1] + 0.05)
    runs = [record("a", factor=1.03), other, record("c", 5.0)]
    assert repeated_tests(runs) == (("a", "b"),)
    early = record("b", factor=1.03, times=np.linspace(0.05, 1.0, 20))
    assert repeated_tests([record("a"), early]) == (("a", "b"),)
    # a start-up whose times were told in minutes ends before the wave has left its first rate
    short = replace(record("a"), time=TIMES / 60.0)
    assert repeated_tests([short, waving("wave", TIMES)]) == ()
    assert count_flows([short, waving("wave", TIMES)]) == 2
    first = record("a", n_points=60.0)
    assert repeated_tests([first, record("b", n_points=400.0)]) == (("a", "b"),)
    assert repeated_tests([first, replace(record("b"), strain_before=10.0)]) == ()
    assert repeated_tests([]) == ()


@pytest.mark.parametrize(
    "other",
    [{"rate": 2.1}, {"temperature_C": 170.0}, {"times": TIMES[:5]}, {"gap_mm": 1.0}],
    ids=["rate", "temperature", "few samples", "a condition of one alone"],
)
def test_another_test_is_no_repeat(other):
    first = record("a", temperature_C=160.0)
    second = record("b", **{"temperature_C": 160.0, **other})
    assert repeated_tests([first, second]) == ()


@pytest.mark.parametrize(
    "after",
    [
        lambda size: dc.after_step_strain(dc.start_up(0.0), size, first=TIMES[0]),
        lambda size: dc.after_steady_flow(dc.start_up(0.1), size, end=TIMES[-1]),
    ],
    ids=["step strain", "steady flow"],
)
def test_what_a_protocol_did_before_the_record_makes_another_test(after):
    sizes = enumerate((0.5, 2.0, 5.0, 5.0))
    runs = [replace(record(f"{i}", seed=i), protocol=after(size)) for i, size in sizes]
    assert count_flows(runs) == 3
    assert repeated_tests(runs) == (("2", "3"),)


def waving(name, times):
    rates = 2.0 * np.cos(times)
    stress = Giesekus(0.3).respond(oscillation(2.0, 1.0), times).sigma12
    return dc.Run(name, times, dc.protocols.oscillatory_shear(2.0, 1.0), rates, stress)


COPIED = np.linspace(0.1, 8.0, 80)


def noisy(seed=0, rate=2.0):
    return record("a.csv", rate, noise=0.01, seed=seed, times=COPIED)


def third(run):
    return run.window(np.arange(len(run)) % 3 == 0)


def test_a_record_is_a_copy_whatever_its_name_digits_and_samples_and_a_second_measurement_none():
    first = noisy()
    assert is_copy(first, replace(first, name="b.csv"))
    four_digits = np.array([float(f"{value:.4g}") for value in first.stress])
    assert is_copy(first, replace(first, name="b.csv", stress=four_digits))
    assert is_copy(first, third(first))
    told_at_another_rate = dc.Run("b.csv", COPIED, dc.start_up(2.2), first.rate * 1.1, first.stress)
    assert is_copy(told_at_another_rate, first)
    assert not is_copy(first, noisy(1))
    assert not is_copy(first, third(noisy(1)))
    assert not is_copy(first, noisy(0, 2.1))
    assert not is_copy(record("a.csv", 2.0), record("b.csv", 2.001))


def test_a_record_that_is_fitted_judges_nothing():
    first, other = noisy(), noisy(1)
    again = replace(first, name="b.csv")
    with pytest.raises(InputError, match=r"held-out run 'b.csv'.*'a.csv'.*proves nothing"):
        require_no_copies([first, other], [again])
    require_no_copies([first], [other])
