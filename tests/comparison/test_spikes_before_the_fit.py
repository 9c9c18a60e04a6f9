"""Samples that stand alone bend no law: a comparison leaves them out before it fits."""

import numpy as np
import pytest
from independent import Giesekus, start_up
from independent.noise import white

from discover.comparison.flows import without_spikes_in_fit
from discover.dataset import Dataset, Run
from discover.protocols import start_up as protocol
from discover.study.data import StudyData

TIMES = np.linspace(0.1, 8.0, 80)
KNOCKS = [20, 45]


def run(rate, knocked):
    exact = Giesekus(0.3, 100.0).respond(start_up(rate), TIMES).sigma12
    stress = white(exact, 0.01, np.random.default_rng(int(10 * rate)))
    stress[KNOCKS] += knocked * np.sqrt(np.mean(exact**2)) * np.array([1.0, -0.6])
    return Run(f"{rate}.csv", TIMES, protocol(rate), np.full(80, rate), stress)


def data(knocked):
    runs = tuple(run(rate, knocked) for rate in (0.5, 2.0, 3.0))
    fit, held = Dataset("fit", runs[:2]), Dataset("held", runs[2:])
    return StudyData(Dataset("all", runs), fit, held)


def test_knocks_are_left_out_of_the_fitted_runs_and_told():
    left, told = without_spikes_in_fit(data(0.8))
    for one in left.fit.runs:
        np.testing.assert_array_equal(one.time, np.delete(TIMES, KNOCKS))
    assert "2 of 0.5.csv, 2 of 2.0.csv" in told
    # what judges is whole
    assert len(left.held_out.runs[0]) == len(TIMES)


@pytest.mark.parametrize("knocked", [0.0, 0.01])
def test_of_a_record_without_a_knock_nothing_is_left_out(knocked):
    whole = data(knocked)
    left, told = without_spikes_in_fit(whole)
    assert left is whole
    assert told == ""
