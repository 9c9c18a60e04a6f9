"""What the small-strain check says of a law, where the data can tell and where they cannot."""

import numpy as np
import pytest
from discover.comparison.judging.constants.declared_constants import OtherConstant
from discover.comparison.judging.constants.small_strain import with_small_strain_told
from discover.comparison.judging.explanation import Explanation
from discover.comparison.outcomes.outcome import LearnerOutcome

from discover.learners import RecoveredTerm
from discover.statistics import LackOfFit

NAME = "small-strain limit"
RIGHT_TIME = OtherConstant("sigma", -0.3, 0.7, 1.0 / 0.7, (1.42, 1.44))
OF_RIGHT_TIME = 0.3 / 0.7  # |f_λ − 1|, in slow flow


def told(learner, value, noise, terms=(), others=(), passed=False):
    """Return the check of a law of which records with such noise say no more."""
    physics = {
        "text": "",
        "checks": [{"name": NAME, "passed": passed, "value": value, "text": "Off."}],
    }
    one = LearnerOutcome(learner, tuple(terms), 1.0, (np.zeros(0), np.zeros(0)), physics=physics)
    left = LackOfFit("explained", noise, noise, 0.0, 1.0)
    found = with_small_strain_told({learner: one}, Explanation({learner: left}), others)
    after = found[learner].physics
    assert after is not None
    return after["checks"][0]


def linear(value, half):
    return RecoveredTerm("sigma", value, ci95=(value - half, value + half))


def test_a_network_off_by_less_than_the_noise_does_not_fail():
    check = told("tbnn_ude", 0.0045, 0.01)
    assert check["passed"] is None
    assert "Not tested to better than 1 %" in check["text"]


@pytest.mark.parametrize("learner", ["tbnn_ude", "tensor_sindy"])
def test_a_law_far_off_fails(learner):
    # −0.18 σ + 0.21 γ̇ at 0.3 % noise: a loading error of a measured melt
    terms = [linear(-0.18, 0.01), RecoveredTerm("gammadot", 0.21, ci95=(0.2, 0.22))]
    check = told(learner, 0.36, 0.003, terms)
    assert check["passed"] is False
    assert check["text"] == "Off."


def test_a_linear_term_that_its_interval_tells_fails_in_louder_noise():
    # its interval, not the noise of one sample, says how well it is known
    assert told("tensor_sindy", 0.04, 0.05, [linear(0.04, 0.004)])["passed"] is False
    open_ = told("tensor_sindy", 0.04, 0.01, [linear(0.04, 0.05)])
    assert open_["passed"] is None
    assert "intervals" in open_["text"]


def test_another_constant_than_declared_is_no_fault_of_the_law():
    check = told("tensor_sindy", OF_RIGHT_TIME, 0.01, [linear(-0.3, 0.003)], [RIGHT_TIME])
    assert check["passed"] is None
    assert "relaxation_time_s" in check["text"]
    # but what is off by more than that constant makes is one
    beyond = told("tensor_sindy", OF_RIGHT_TIME + 0.1, 0.01, [linear(-0.3, 0.003)], [RIGHT_TIME])
    assert beyond["passed"] is False


def test_a_law_that_passes_is_left_alone():
    assert told("tbnn_ude", 1e-4, 0.01, passed=True)["text"] == "Off."
