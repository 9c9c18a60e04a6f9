"""Few samples a cycle: the law comes out right, or it is said that they hide it. Truth by scipy."""

import numpy as np
import pytest
from discover.comparison.fitting.sampled_rates import coarse_rates_of, with_sampled_rates
from discover.comparison.outcomes.flows import Flow, predict
from discover.comparison.outcomes.outcome import LearnerOutcome
from independent import Giesekus, oscillation

import discover as dc
from discover.laws import Fluid, make_law
from discover.learners import RecoveredTerm
from discover.protocols import measured_rate, oscillatory_shear, sampled_rate

MODULUS, TIME, MOBILITY, NOISE = 100.0, 1.0, 0.3, 0.01
EFFECTS = ["giesekus_mobility", "ptt_linear", "non_affine_motion", "stress_gain", "stress_offset"]
BASE = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME)


def records(samples, noise=NOISE):
    """Yield amplitude, times, rates read there, and noisy stresses of two oscillations."""
    generator = np.random.default_rng(0)
    times = np.arange(max(4, 60 // samples) * samples + 1) * 2.0 * np.pi / samples
    for amplitude in (2.0, 5.0):
        flow = oscillation(amplitude, 1.0)
        stress = Giesekus(MOBILITY, MODULUS, TIME).respond(flow, times[1:]).sigma12
        stress = np.append(0.0, stress)
        size = np.sqrt(np.mean(stress**2))
        stress = stress + noise * size * generator.standard_normal(len(times))
        yield amplitude, times, amplitude * np.cos(times), stress


def outcome(samples, protocol_of, noise=NOISE):
    """Return what is told of a law that is known exactly, in oscillations of so many samples."""
    flows = []
    for amplitude, times, rates, stress in records(samples, noise):
        protocol = protocol_of(amplitude, times, rates)
        measured = stress / MODULUS
        name = f"{amplitude:g}"
        flows.append(Flow(name, "training", protocol, times, rates, {}, measured))
    fluid = Fluid.dimensionless(make_law("giesekus", {"alpha": MOBILITY}))
    predictions = {flow.key: predict(fluid, flow) for flow in flows}
    history = (np.zeros(0), np.zeros(0))
    terms = (RecoveredTerm("sigma.sigma", MOBILITY, ci95=(0.298, 0.302)),)
    made = LearnerOutcome("tensor_sindy", terms, 0.0, history, predictions=predictions)
    return with_sampled_rates(made, fluid, Fluid.dimensionless(make_law("ucm")), flows)


def read(amplitude, times, rates):
    return sampled_rate(times, rates)


def test_a_comparison_says_the_same_and_widens_the_intervals():
    few = outcome(3, read)
    hidden = coarse_rates_of(few)
    assert hidden is not None
    assert "sampled too coarsely: 3 samples a cycle" in hidden.sentence
    assert hidden.shifts["sigma.sigma"] > 1.0
    low, high = few.terms[0].ci95
    assert high - low > 2.0 * 0.004


@pytest.mark.slow
def test_seven_samples_a_cycle_are_too_few_only_where_there_is_no_noise():
    # seven are enough beside 1 % of noise, and not beside none
    assert coarse_rates_of(outcome(7, read)) is None
    clean = outcome(7, read, noise=1e-5)
    assert coarse_rates_of(clean) is not None
    # of the order of what the spline does leave
    told = clean.details["sampled_rate"]
    assert 0.3 * told["left"] < told["change"] < 3.0 * told["left"]


def test_a_commanded_rate_leaves_nothing_open():
    commanded = outcome(3, lambda amplitude, times, rates: oscillatory_shear(amplitude, 1.0))
    assert "sampled_rate" not in commanded.details
    assert commanded.terms[0].ci95 == (0.298, 0.302)


@pytest.mark.slow
def test_samples_dense_enough_leave_nothing_open():
    dense = outcome(60, lambda amplitude, times, rates: measured_rate(times, rates))
    assert coarse_rates_of(dense) is None
