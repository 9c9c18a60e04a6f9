"""What repeated tests say of their error; records by scipy, in shares of a known loading error."""

from dataclasses import replace

import numpy as np
import pytest
from independent import Giesekus, oscillation, start_up

import discover as dc
from discover.dataset.records.repeats import count_flows, repeated_tests, repeats_among

TIMES = np.linspace(0.05, 8.0, 60)


def record(name, rate=2.0, factor=1.0, noise=0.0, seed=0, times=TIMES, **metadata):
    exact = factor * Giesekus(0.3).respond(start_up(rate), times).sigma12
    off = (
        noise * np.sqrt(np.mean(exact**2)) * np.random.default_rng(seed).standard_normal(len(times))
    )
    rates = np.full(len(times), rate)
    return dc.Run(name, times, dc.start_up(rate), rates, exact + off, metadata=metadata)


def test_loadings_that_differ_by_a_factor_are_told_with_its_size():
    found = repeats_among([record("a", factor=1.03), record("b", factor=0.97), record("c", 5.0)])
    assert found is not None
    assert found.groups == (("a", "b"),)
    assert found.error == pytest.approx(0.06 / np.sqrt(2.0), rel=1e-3)


def test_noise_alone_comes_out_with_its_size_also_at_other_times():
    runs = [record(str(seed), noise=0.02, seed=seed) for seed in range(6)]
    assert repeats_among(runs).error == pytest.approx(0.02, rel=0.15)
    # a record between whose samples the other is read: exact curves differ by next to nothing
    shifted = [record("a"), record("b", times=TIMES[:-1] + 0.05)]
    assert repeats_among(shifted).error < 2e-3


@pytest.mark.parametrize(
    "other",
    [{"rate": 2.1}, {"temperature_C": 170.0}, {"times": TIMES[:5]}, {"gap_mm": 1.0}],
    ids=["rate", "temperature", "few samples", "a condition of one alone"],
)
def test_another_test_is_no_repeat(other):
    first = record("a", temperature_C=160.0)
    second = record("b", **{"temperature_C": 160.0, **other})
    assert repeats_among([first, second]) is None


def test_another_history_is_no_repeat_and_a_count_of_the_source_is_no_condition():
    first = record("a", n_points=60.0)
    assert repeats_among([first, record("b", n_points=400.0)]) is not None
    assert repeats_among([first, replace(record("b"), strain_before=10.0)]) is None
    assert repeats_among([]) is None


def waving(name, times):
    rates = 2.0 * np.cos(times)
    stress = Giesekus(0.3).respond(oscillation(2.0, 1.0), times).sigma12
    return dc.Run(name, times, dc.protocols.oscillatory_shear(2.0, 1.0), rates, stress)


def test_runs_that_only_begin_alike_are_no_repeat():
    # a start-up whose times were told in minutes ends before the wave has left its first rate
    short = replace(record("a"), time=TIMES / 60.0)
    assert repeated_tests([short, waving("wave", TIMES)]) == ()
    assert count_flows([short, waving("wave", TIMES)]) == 2


def test_what_differs_by_more_than_loadings_do_excuses_nothing():
    # in minutes, and longer: the same rate, and another time
    minutes = replace(record("a", times=60.0 * TIMES), time=TIMES)
    runs = [record("b"), minutes]
    assert repeats_among(runs) is None
    # it stays one flow, and other repeats tell their error
    assert count_flows(runs) == 1
    found = repeats_among([*runs, record("c", factor=1.03)])
    assert found is not None
    assert found.groups == (("b", "c"),)
    assert found.error == pytest.approx(0.03 / np.sqrt(2.0), rel=0.03)


def test_a_run_that_ends_early_is_the_same_flow_and_tells_little():
    early = record("b", factor=1.03, times=np.linspace(0.05, 1.0, 20))
    assert repeated_tests([record("a"), early]) == (("a", "b"),)
    assert repeats_among([record("a"), early]) is None
