"""Constants beside a term that is a wrong relaxation time hold their value with the right one."""

import numpy as np
import pytest
from independent import Giesekus, start_up

import discover as dc

TIMES = np.linspace(0.1, 8.0, 60)


def looped(told: float):
    runs = []
    for seed, rate in enumerate((0.3, 1.0, 3.0, 5.0)):
        stress = Giesekus(0.3, 100.0, 1.0).respond(start_up(rate), TIMES).sigma12
        noise = np.sqrt(np.mean(stress**2)) * np.random.default_rng([7, seed]).normal(0, 0.01, 60)
        rates = np.full(60, rate)
        runs.append(dc.Run(f"at_{rate:g}", TIMES, dc.start_up(rate), rates, stress + noise))
    data = dc.Dataset("giesekus", tuple(runs))
    base = dc.Fluid(dc.make_law("ucm"), 100.0, told)
    options = {"effects": ["giesekus_mobility", "sigma"], "max_effects": 2, "explanations": 1}
    return dc.close_loop(data, base, held_out=["at_3"], **options)


def mobility(loop):
    stage = next(stage for stage in loop.stages if stage.effect == "giesekus_mobility")
    return stage.parameters["alpha"]


def test_a_mobility_is_that_of_the_declared_time_or_of_the_right_one():
    loop = looped(1.1)
    linear = next(stage for stage in loop.stages if stage.effect == "sigma")
    assert "relaxation_time_factor" in linear.aliases
    found = mobility(loop)
    # λ s▽ = ... − (1 + c) s − α s·s is the law of the time λ/(1 + c) and the mobility α/(1 + c)
    assert found.ci95_given_effects[0] > 0.3
    assert found.ci95[0] < 0.3 < found.ci95[1]


def test_with_the_right_time_the_interval_is_that_of_the_effect():
    found = mobility(looped(1.0))
    assert found.ci95[0] < 0.3 < found.ci95[1]
    assert np.ptp(found.ci95) < 1.5 * np.ptp(found.ci95_given_effects)
