"""One record under two names is one measurement: closed forms of a Maxwell fluid."""

import numpy as np
import pytest

from discover.dataset import Run
from discover.dataset.records.repeats import is_copy, require_no_copies
from discover.errors import InputError
from discover.protocols import start_up

TIMES = np.linspace(0.1, 8.0, 80)


def run(name, stress, times=TIMES, rate=2.0):
    return Run(name, times, start_up(rate), np.full(len(times), rate), stress)


def grown(seed, rate=2.0, times=TIMES):
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
    assert is_copy(first, run("b.csv", grown(0)[::3], TIMES[::3]))
    assert is_copy(run("b.csv", grown(0), rate=2.2), first)  # told at another rate


def test_a_second_measurement_is_none():
    first = run("a.csv", grown(0))
    assert not is_copy(first, run("b.csv", grown(1)))
    assert not is_copy(first, run("b.csv", grown(1)[::3], TIMES[::3]))
    assert not is_copy(first, run("b.csv", grown(0, 2.1), rate=2.1))


def test_exact_records_of_two_rates_are_none():
    exact = {rate: 100.0 * rate * -np.expm1(-TIMES) for rate in (2.0, 2.001)}
    assert not is_copy(*(run(str(r), stress, rate=r) for r, stress in exact.items()))


def test_a_record_that_is_fitted_judges_nothing():
    first, again, other = run("a.csv", grown(0)), run("b.csv", grown(0)), run("c.csv", grown(1))
    with pytest.raises(InputError, match=r"held-out run 'b.csv'.*'a.csv'.*proves nothing"):
        require_no_copies([first, other], [again])
    require_no_copies([first], [other])
