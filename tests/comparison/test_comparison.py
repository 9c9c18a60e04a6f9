"""Comparing learners: errors, what stays open, what is kept, what JSON holds."""

import json

import numpy as np
import pytest

from discover.comparison import LearnerOutcome, compare, relative_errors
from discover.comparison.comparison import Comparison
from discover.comparison.flows import true_terms
from discover.laws import Fluid, make_law
from discover.learners import LearnerResult, RecoveredTerm
from discover.study import parse_study


def fake_study(**compare_options):
    made = {
        "law": "giesekus",
        "parameters": {"alpha": 0.2},
        "noise": 0.01,
        "samples": 21,
        "seed": 1,
    }
    options = {"high_deborah": [1.5], "library": {"degree": 0}, **compare_options}
    return parse_study({"data": {"synthetic": made}, "compare": options})


def trained(learner, study, model, runs, seed=0, progress=None):
    mobility = 0.2 if learner == "tensor_sindy" else 0.22
    law = make_law("giesekus", {"alpha": mobility})
    term = RecoveredTerm("sigma.sigma", mobility, coefficient_penalised=0.19, ci95=(0.19, 0.21))
    result = LearnerResult(learner, law, (term,), 1.5, {}, "fake")
    return result, Fluid.dimensionless(law)


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("discover.comparison.learning.train", trained)
        # what has tests of its own, and stands on the page of test_reports
        patch.setattr("discover.comparison.learning.physics_of", lambda *_: {"checks": []})
        return compare(fake_study())


@pytest.mark.slow
def test_a_perfect_learner_has_no_error_and_a_wrong_one_has(comparison):
    for flow in comparison.flows_of("test"):
        assert max(comparison.errors("tensor_sindy", flow).values()) < 1e-6  # solver tolerance
        assert comparison.errors("tbnn_ude", flow)["N1"] > 0.01
        assert comparison.errors("before", flow)["sigma12"] > 0.3


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


def test_an_outcome_comes_back_from_its_state_unchanged():
    term = RecoveredTerm("sigma.sigma", 0.22, coefficient_penalised=0.19, ci95=(0.19, 0.21))
    wave = {"sigma12": np.sin(np.arange(5.0)) / 3.0, "N1": np.array([0.1, np.nan])}
    outcome = LearnerOutcome("tbnn_ude", (term,), 1.5, predictions={"test/a": wave, "test/b": None})
    again = LearnerOutcome.from_state(json.loads(json.dumps(outcome.to_state())))
    assert again.terms == outcome.terms
    assert again.predictions["test/b"] is None
    for quantity, values in wave.items():
        np.testing.assert_array_equal(again.predictions["test/a"][quantity], values)


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
