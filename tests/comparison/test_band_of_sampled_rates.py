"""A rate read at the samples leaves a band, however well the law is known: truth from scipy."""

import numpy as np
import pytest
from discover.comparison.judging.next_measurement import bands_of_law
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from independent import Giesekus, oscillation

from discover.laws import Fluid, make_law
from discover.learners import RecoveredTerm
from discover.protocols.protocol import measured_rate, oscillatory_shear

AMPLITUDE, FREQUENCY = 5.0, 1.5
TIMES = np.linspace(0.02, 8.0, 100)
RATE = AMPLITUDE * np.cos(FREQUENCY * TIMES)


def band(protocol):
    """Return the band of a Giesekus law that is known exactly."""
    flow = Flow("swing", "held_out", protocol, TIMES, RATE, {}, oscillatory=True)
    history = (np.zeros(0), np.zeros(0))
    terms = (RecoveredTerm("sigma.sigma", 0.3),)
    outcome = LearnerOutcome("tensor_sindy", terms, 0.0, history)
    fluid = Fluid.dimensionless(make_law("ucm"))
    return bands_of_law(outcome, [], fluid, [flow])[flow.key]


@pytest.mark.slow
def test_the_band_holds_what_straight_lines_between_the_samples_miss():
    truth = Giesekus(0.3).respond(oscillation(AMPLITUDE, FREQUENCY), TIMES)
    read = band(measured_rate(TIMES, RATE))
    for column, true in enumerate((truth.sigma12, truth.N1, truth.N2)):
        off = np.abs(read.chosen[:, column] - true)
        assert np.sqrt(np.mean(off**2)) > 1e-4 * np.sqrt(np.mean(true**2))
        inside = (read.rivals_low[:, column] <= true) & (true <= read.rivals_high[:, column])
        assert np.mean(inside) >= 0.9
        # and no more than a reader would: the error of reading once in 18 of a cycle
        half = 0.5 * (read.rivals_high - read.rivals_low)[:, column]
        assert np.sqrt(np.mean(half**2)) < 5.0 * np.sqrt(np.mean(off**2))
    # a rate that was commanded leaves nothing open
    exact = band(oscillatory_shear(AMPLITUDE, FREQUENCY))
    np.testing.assert_array_equal(exact.rivals_low, exact.rivals_high)
    assert np.max(np.abs(exact.chosen[:, 1] - truth.N1)) < 1e-4 * np.max(truth.N1)
