"""Comparing learners: errors, what stays open, and how parts side by side end."""

import threading

import numpy as np
import pytest

from discover.comparison import relative_errors
from discover.comparison.flows import true_terms
from discover.comparison.hypotheses import at_once
from discover.progress import Stopped, require_wanted, silent


def test_n2_error_is_relative_to_n1():
    reference = {"sigma12": np.ones(4), "N1": 2.0 * np.ones(4), "N2": np.zeros(4)}
    prediction = {"sigma12": 1.1 * np.ones(4), "N1": 2.0 * np.ones(4), "N2": 0.2 * np.ones(4)}
    errors = relative_errors(prediction, reference)
    assert errors["sigma12"] == pytest.approx(0.1)
    assert errors["N1"] == 0.0
    assert errors["N2"] == pytest.approx(0.1)


def test_what_was_not_measured_has_no_error():
    errors = relative_errors({"sigma12": np.ones(3), "N1": np.ones(3), "N2": np.ones(3)},
                             {"sigma12": np.ones(3)})  # fmt: skip
    assert errors == {"sigma12": 0.0, "N1": None, "N2": None}
    assert relative_errors(None, {"sigma12": np.ones(3)})["sigma12"] is None


@pytest.mark.parametrize(
    ("law", "parameters", "terms"),
    [
        ("ucm", {}, []),
        ("giesekus", {"alpha": 0.3}, [("sigma.sigma", 0.3)]),
        ("saramito", {"yield_strain": 0.1}, None),
    ],
)
def test_true_terms_are_those_of_the_law_and_of_a_relaxation_that_is_not_known(
    law, parameters, terms
):
    for known, more in ((True, []), (False, [("sigma", 1.0)])):
        found = true_terms(law, parameters, known)
        told = None if found is None else [(one.term, one.coefficient) for one in found]
        assert told == (None if terms is None else [*more, *terms])


@pytest.mark.parametrize("says", [True, False])
def test_when_one_part_fails_the_others_end_where_they_say_or_ask_something(says):
    ended = []

    def fails(say):
        raise ValueError("no law")

    def goes_on(say):
        try:
            for _ in range(100_000):
                threading.Event().wait(0.001)
                say("at work", 0.0) if says else require_wanted()
        except Stopped:
            ended.append(True)
            raise

    with pytest.raises(ValueError, match="no law"):
        at_once({"goes on": goes_on, "fails": fails}, silent)
    assert ended == [True]


def test_an_interrupt_of_the_caller_ends_all_parts():
    def goes_on(say):
        while True:
            threading.Event().wait(0.001)
            say("at work", 0.0)

    def interrupted(text, fraction):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        at_once({"one": goes_on, "other": goes_on}, interrupted)
