"""An effect that takes little away need not have the right shape, and is believed less for it."""

import numpy as np
import pytest
from independent import Giesekus, start_up

import discover as dc

TIMES, NOISE, RATES = np.linspace(0.1, 7.0, 60), 0.05, (0.5, 2.0, 4.0, 3.0)


def read_with_gain(gain):
    """Start-ups of a Giesekus fluid by scipy, read too large by a factor 1 + gain."""
    runs = []
    for seed, rate in enumerate(RATES):
        law = Giesekus(0.3, modulus=100.0, relaxation_time=1.0)
        stress = (1.0 + gain) * law.respond(start_up(rate), TIMES).sigma12
        noise = NOISE * np.sqrt(np.mean(stress**2))
        stress = stress + noise * np.random.default_rng(seed).standard_normal(len(TIMES))
        rates = np.full(len(TIMES), rate)
        runs.append(dc.Run(f"at {rate:g}", TIMES, dc.start_up(rate), rates, stress))
    return dc.Dataset("giesekus", tuple(runs))


@pytest.mark.parametrize(
    ("gain", "low", "high"), [(0.08, 0.5, 0.8), pytest.param(0.4, 0.8, 0.9, marks=pytest.mark.slow)]
)
def test_a_set_is_no_likelier_than_the_shape_of_its_smallest_effect_was_tested(gain, low, high):
    loop = dc.close_loop(
        read_with_gain(gain), dc.Fluid(dc.make_law("ucm"), 100.0, 1.0),
        effects=["giesekus_mobility", "stress_gain"], max_effects=2,
        held_out=["at 3"],
    )  # fmt: skip
    assert {stage.effect for stage in loop.stages} == {"giesekus_mobility", "stress_gain"}
    both = loop.explanations.holding(["giesekus_mobility", "stress_gain"])
    # twice the logarithm of the likelihood that the gain takes off, if its shape is right: 180
    # samples of a misfit of gain over noise, less what the mobility makes up for
    most = 1.0 / (1.0 + np.sqrt(45.0 / (180.0 * (gain / (1.0 + gain) / NOISE) ** 2)))
    assert both.probability <= most
    assert low < both.probability < high
