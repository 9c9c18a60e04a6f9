"""The noise of the next experiment is that of the records, without what stood out of them."""

import numpy as np
import pytest
from discover.comparison.judging.next_measurement import LEAST_NOISE, next_measurement
from discover.comparison.outcomes.outcome import LearnerOutcome

from discover.laws import Fluid, make_law
from discover.study.compare_section import NextExperiment


@pytest.mark.parametrize(
    ("whole", "without_outliers", "expected"),
    [(0.18, 0.01, 0.01), (0.18, None, 0.18), (0.18, 0.0, LEAST_NOISE)],
)
def test_outliers_are_no_noise_of_the_next_experiment(whole, without_outliers, expected):
    history = (np.zeros(0), np.zeros(0))
    outcome = LearnerOutcome("tensor_sindy", (), 0.0, history, details={"misfit": whole})
    fluid = Fluid.dimensionless(make_law("ucm"))
    found = next_measurement(outcome, [], fluid, NextExperiment(), misfit=without_outliers)
    assert found.noise == expected
