"""A step of the rate between two samples is seen as one, and nothing else is."""

import numpy as np
import pytest

import discover as dc
from discover.protocols import measured_rate, sampled_rate
from discover.protocols.between_samples import steps_between_samples

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


def test_a_step_whose_instant_is_given_is_not_in_question():
    given = dc.step_rates([0.0, 3.93], [1.0, 3.0])
    assert steps(STEP, protocol=given) == ()
    assert len(steps(STEP, protocol=measured_rate(TIMES, STEP))) == 1


def test_a_step_at_either_end_of_a_record_is_no_step():
    """One sample beyond it tells nothing of where it happened that its own error does not hide."""
    for edge in (1, 80):
        rate = np.where(np.arange(81) < edge, 1.0, 3.0)
        assert steps(rate) == ()
