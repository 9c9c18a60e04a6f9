"""What a law leaves of runs, judged: noise, something more, or of records that hold nothing."""

import numpy as np
import pytest
from independent import Giesekus, oscillation, start_up
from independent.noise import correlated, proportional, rms, white

import discover as dc
from discover.learners.lack_of_fit import lack_of_fit

GROWTH, WAVE = np.linspace(0.1, 10.0, 80), np.linspace(0.0, 12.0, 121)
FLOWS = {
    "slow": (start_up(0.5), dc.start_up(0.5), GROWTH),
    "fast": (start_up(2.0), dc.start_up(2.0), GROWTH),
    "wave": (oscillation(2.0, 1.0), dc.oscillatory_shear(2.0, 1.0), WAVE),
}
MOBILITY = 0.3
LAW = dc.Fluid(dc.make_law("giesekus", {"alpha": MOBILITY}))
NOISES = {
    "white": lambda row, generator: white(row, 0.01, generator),
    "slow": lambda row, generator: correlated(row, 0.03, 0.9, generator),
    "less slow": lambda row, generator: correlated(row, 0.03, 0.6, generator),
    "proportional": lambda row, generator: proportional(row, 0.05, generator),
}


def records(noise, seed):
    material, generator = Giesekus(MOBILITY), np.random.default_rng(seed)
    return [
        dc.Run(name, times, protocol, flow.rate(times),
               noise(material.respond(flow, times).sigma12, generator))
        for name, (flow, protocol, times) in FLOWS.items()
    ]  # fmt: skip


@pytest.mark.parametrize("noise", NOISES.values(), ids=NOISES)
def test_the_law_that_made_the_data_leaves_noise(noise):
    found = [lack_of_fit(LAW, records(noise, seed)) for seed in range(20)]
    # of so many wrong decisions in ten thousand would be one
    assert sum(one.verdict == "explained" for one in found) >= 18


def test_a_smooth_misfit_larger_than_the_noise_is_no_slow_noise():
    near = dc.Fluid(dc.make_law("giesekus", {"alpha": 0.34}))
    exact = [Giesekus(MOBILITY).respond(flow, times).sigma12 for flow, _, times in FLOWS.values()]
    other = [Giesekus(0.34).respond(flow, times).sigma12 for flow, _, times in FLOWS.values()]
    missed = np.mean([rms(a - b) / rms(a) for a, b in zip(exact, other, strict=True)])
    assert 0.01 < missed < 0.03
    found = [lack_of_fit(near, records(NOISES["white"], seed)) for seed in range(20)]
    assert sum(one.verdict == "unexplained" for one in found) >= 18
    # what changes from sample to sample is all that is called noise then
    assert np.mean([one.noise for one in found]) == pytest.approx(0.01, rel=0.15)
    assert np.mean([one.misfit for one in found]) > 1.3 * 0.01


def test_noise_that_may_as_well_be_a_smooth_misfit_is_told_so():
    slow, fast = (lack_of_fit(LAW, records(NOISES[name], 0)) for name in ("slow", "white"))
    assert "if that is correlated to" in slow.described
    assert fast.described.startswith("Fits within the noise of")
    assert "correlated" not in fast.described


def test_noise_alone_is_no_signal():
    runs = records(lambda row, generator: generator.standard_normal(len(row)), 0)
    found = lack_of_fit(dc.Fluid(modulus=1e-3), runs)
    assert found.verdict == "no_signal"
    assert "hold no signal" in found.described


@pytest.mark.parametrize("samples", [3, 6])
def test_a_run_of_a_few_samples_is_judged_by_the_noise_of_longer_ones(samples):
    runs, times = records(NOISES["white"], 1), np.linspace(1.0, 2.0, samples)
    exact = Giesekus(MOBILITY).respond(start_up(1.0), times).sigma12
    for factor, verdict in ((1.01, "explained"), (1.1, "unexplained")):
        few = dc.Run("few", times, dc.start_up(1.0), np.ones(samples), factor * exact)
        assert lack_of_fit(LAW, [*runs, few]).verdict == verdict


def test_errors_of_the_moduli_may_leave_a_pattern_of_their_size():
    runs = records(NOISES["white"], 2)
    off = {"law": LAW.law, "modulus": 1.04, "relaxation_time": 1.0}
    assert lack_of_fit(dc.Fluid(**off), runs).verdict == "unexplained"
    told = dc.Fluid(**off, modulus_covariance=np.array([[0.04**2]]))
    assert lack_of_fit(told, runs).verdict == "explained"


def test_a_noise_that_is_given_is_the_noise_unless_it_is_far_too_small():
    found = lack_of_fit(LAW, records(NOISES["white"], 0), noise=0.008)
    assert (found.noise, found.verdict) == (0.008, "explained")
    found = lack_of_fit(LAW, records(NOISES["white"], 0), noise=0.001)
    # three records of some 90 samples of 1 % noise: their mean is told to 5 %
    assert found.verdict == "explained"
    assert found.noise == pytest.approx(0.01, rel=0.2)
    assert "0.1 %" not in found.described
