"""A rate between its samples: smooth where the samples say so, straight lines across jumps."""

import numpy as np
import pandas as pd
import pytest
from independent import Giesekus, of_rate, oscillation

import discover as dc
from discover.dataset import from_dataframe
from discover.dataset.records.thinning import thin_run
from discover.protocols import (
    after_steady_flow,
    another_between_samples,
    measured_rate,
    sampled_rate,
    shear_rates,
    step_rates,
)
from discover.protocols.between_samples import steps_between_samples

AMPLITUDE = 4.0


def wave(samples, cycles=4, noise=0.0):
    times = np.arange(cycles * samples + 1) * 2.0 * np.pi / samples
    error = noise * np.random.default_rng(0).standard_normal(len(times))
    return times, AMPLITUDE * (np.cos(times) + error)


def off(protocol, exact, times):
    dense = np.linspace(times[0], times[-1], 2001)
    return np.max(np.abs(shear_rates(protocol, dense) - exact(dense))) / AMPLITUDE


@pytest.mark.parametrize("samples", [5, 7, 10, 15, 30])
def test_a_wave_is_followed_between_its_samples_and_straight_lines_cut_it(samples):
    times, rates = wave(samples)
    found = off(sampled_rate(times, rates), lambda t: AMPLITUDE * np.cos(t), times)
    straight = off(measured_rate(times, rates), lambda t: AMPLITUDE * np.cos(t), times)
    phase = 2.0 * np.pi / samples
    # 1 − cos of half the phase between samples
    assert straight == pytest.approx(1.0 - np.cos(0.5 * phase), rel=0.1)
    # a cubic spline errs by its fourth order, at the ends, which have no neighbours, by some more
    assert found < 0.02 * phase**4 + 2e-3
    np.testing.assert_allclose(shear_rates(sampled_rate(times, rates), times), rates, atol=1e-9)


def giesekus(rate, times):
    return Giesekus(0.3).respond(of_rate(rate, times[-1]), times).sigma12


@pytest.mark.parametrize("noise", [pytest.param(0.0, marks=pytest.mark.slow), 0.01])
def test_the_stress_of_a_coarse_wave_is_right_to_what_noise_in_the_rate_does(noise):
    times, rates = wave(7, noise=noise)
    truth = Giesekus(0.3).respond(oscillation(AMPLITUDE, 1.0), times[1:]).sigma12
    size = np.sqrt(np.mean(truth**2))

    def missed(protocol):
        knots, values = np.asarray(protocol.table_times), np.asarray(protocol.table_rates)
        found = giesekus(lambda t: np.interp(t, knots, values), times[1:])
        return np.sqrt(np.mean((found - truth) ** 2)) / size

    # 1 % of noise in the rate is 1 % in the stress at most; the spline itself errs by 0.2 %
    assert missed(sampled_rate(times, rates)) < 0.003 + noise
    assert missed(measured_rate(times, rates)) > 0.02


@pytest.mark.parametrize("between", [0.2, 0.7])
def test_across_a_jump_no_spline_swings(between):
    times = np.arange(40.0) - between
    rates = np.where(times < 20.0, 1.0, 5.0)
    found = sampled_rate(times, rates)
    np.testing.assert_array_equal(found.table_times, times)
    levels = shear_rates(found, np.linspace(times[0], times[-1], 4001))
    assert levels.min() >= 1.0
    assert levels.max() <= 5.0


def test_a_ramp_and_its_corner_are_straight_lines():
    times = np.linspace(0.0, 10.0, 41)
    found = sampled_rate(times, 5.0 - np.abs(times - 5.0))
    np.testing.assert_array_equal(found.table_times, times)


def test_a_wave_that_jumps_is_smooth_on_both_sides_and_keeps_within_its_levels():
    times = np.linspace(0.0, 8.0 * np.pi, 81)

    def exact(t):
        return AMPLITUDE * np.cos(t) + 20.0 * (t > 12.7)

    found = sampled_rate(times, exact(times))
    assert len(found.table_times) > 1.5 * len(times)
    dense = np.linspace(times[0], times[-1], 4001)
    missed = np.abs(shear_rates(found, dense) - exact(dense)) / AMPLITUDE
    # four samples from the jump a tenth of a cycle apart: the wave is followed
    assert np.max(missed[np.abs(dense - 12.7) > 5.0 * times[1]]) < 0.01
    levels = shear_rates(found, dense)
    # straight lines between the levels, and no swing of a part of 20 beyond them
    assert levels.max() < 20.0 + 1.02 * AMPLITUDE
    assert levels.min() > -1.02 * AMPLITUDE


def test_noise_alone_and_constants_stay_as_they_were():
    times = np.linspace(0.0, 10.0, 101)
    noise = 1.0 + 0.01 * np.random.default_rng(0).standard_normal(101)
    found = sampled_rate(times, noise)
    # of 100 windows a cubic is the better by chance in a few
    assert len(found.table_times) < 1.5 * len(times)
    assert len(sampled_rate(times, np.ones(101)).table_times) == 101


def test_another_curve_says_how_much_is_unknown():
    unknown = {}
    for samples in (3, 5, 7, 15):
        times, rates = wave(samples)
        used = sampled_rate(times, rates)
        other = another_between_samples(used, times)
        truth = AMPLITUDE * np.cos(dense := np.linspace(times[0], times[-1], 2001))
        error = np.sqrt(np.mean((shear_rates(used, dense) - truth) ** 2))
        change = np.sqrt(np.mean((shear_rates(other, dense) - shear_rates(used, dense)) ** 2))
        unknown[samples] = change
        # no less than a fifth of the error that it stands for, which here is known
        assert change > 0.2 * error
    assert unknown[15] < 1e-3 * AMPLITUDE < 0.02 * AMPLITUDE < unknown[3]
    # what came before the record stays
    begun = after_steady_flow(sampled_rate(*wave(7)), 2.0, 3.0)
    other = another_between_samples(begun, wave(7)[0])
    np.testing.assert_allclose(shear_rates(other, np.array([-0.5])), 2.0)
    # and a rate that was commanded leaves nothing open
    assert another_between_samples(step_rates([0.0, 1.0], [1.0, 2.0]), wave(7)[0]) is None


def test_a_file_of_few_samples_a_cycle_is_read_so_and_stays_so_when_it_is_thinned():
    times, rates = wave(7, cycles=12)
    table = {"time_s": times, "shear_rate_1_s": rates, "stress_Pa": rates}
    run = from_dataframe(pd.DataFrame(table))[0]
    assert run.metadata["shear_rate_source"].endswith("a cubic spline between samples")
    assert off(run.protocol, lambda t: AMPLITUDE * np.cos(t), times) < 0.02
    thinned = thin_run(run, 40)
    # 5 % of the largest rate is what straight lines of fewer knots may miss
    assert off(thinned.protocol, lambda t: AMPLITUDE * np.cos(t), times) < 0.07


TIMES = np.linspace(0.0, 8.0, 81)
STEP = np.where(TIMES < 3.95, 1.0, 3.0)


def steps(rate, times=TIMES, protocol=None):
    return steps_between_samples(protocol or sampled_rate(times, rate), times, rate)


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_step_lies_between_the_samples_on_its_two_sides(noise):
    rate = STEP + noise * np.random.default_rng(0).standard_normal(81)
    (found,) = steps(rate)
    assert (found.start, found.end) == pytest.approx((3.9, 4.0))
    assert found.change == pytest.approx(2.0, abs=5 * noise + 1e-12)
    assert found.place is None
    assert found.at(0.5) == pytest.approx(3.95)


@pytest.mark.parametrize(
    "rate",
    [
        np.full(81, 2.0),
        2.0 * np.cos(TIMES),
        np.abs(np.mod(TIMES, 2.0) - 1.0),  # a triangle
        np.random.default_rng(1).standard_normal(81),
        np.clip(1.0 + 10.0 * (TIMES - 3.95), 1.0, 3.0),  # the record shows it rise
        np.where(TIMES < 3.95, 1.0, 1.001),
    ],
    ids=["constant", "wave", "triangle", "noise", "rise", "last digit"],
)
def test_no_step_is_seen_in(rate):
    assert steps(rate) == ()


def test_a_step_whose_instant_is_given_or_at_an_end_of_a_record_is_not_in_question():
    given = dc.step_rates([0.0, 3.93], [1.0, 3.0])
    assert steps(STEP, protocol=given) == ()
    assert len(steps(STEP, protocol=measured_rate(TIMES, STEP))) == 1
    # one sample beyond it tells nothing of where it happened that its own error does not hide
    for edge in (1, 80):
        rate = np.where(np.arange(81) < edge, 1.0, 3.0)
        assert steps(rate) == ()
