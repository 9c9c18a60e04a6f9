"""A law that held-out runs refute explains nothing: data from code that is not under test."""

from dataclasses import replace

import numpy as np
import pytest
from discover.comparison.judging.explanation import Explanation, explain
from discover.comparison.judging.unseen_runs import hold_against_unseen, outliers_of
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.identify.rivals.bands import bands_of_predictions
from independent import Giesekus, RoliePoly, start_up
from independent.noise import white

from discover.learners.results.recovered_term import RecoveredTerm
from discover.protocols import start_up as protocol
from discover.statistics.lack_of_fit import LackOfFit
from discover.statistics.residual import Expectation

TIMES = np.geomspace(0.05, 10.0, 80)
RATES = {"slow": 0.5, "fast": 2.0, "held": 4.0}
EMPTY = (np.zeros(0), np.zeros(0))
ONE_TERM = (RecoveredTerm("sigma.sigma", 0.3),)
ALPHAS = 0.3 + 1e-3 * np.random.default_rng(0).standard_normal(20)


def stress(material, rate):
    return material.respond(start_up(rate), TIMES).sigma12


@pytest.fixture(scope="module")
def drawn():
    """σ12 of fluids with an uncertain α, the one that made the data first, by run."""
    return {
        name: np.array([stress(Giesekus(a, 100.0), rate) for a in (0.3, *ALPHAS)])
        for name, rate in RATES.items()
    }


def judged(drawn, held=None, exact=False):
    """Return what is said of α = 0.3 where the held-out run is `held`, by default its own."""
    generator = np.random.default_rng(1)
    flows, predictions, bands = [], {}, {}
    for name, rate in RATES.items():
        kind = "held_out" if name == "held" else "training"
        truth = held if kind == "held_out" and held is not None else drawn[name][0]
        record = white(truth, 0.01, generator)
        measured = record if kind == "training" else None
        rates = np.full(len(TIMES), rate)
        reference = {"sigma12": record}
        flow = Flow(name, kind, protocol(rate), TIMES, rates, reference, measured)
        flows.append(replace(flow, is_truth=exact))
        predictions[flow.key] = {"sigma12": drawn[name][0]}
        three = np.repeat(drawn[name][:, None, :, None], 3, axis=3)
        bands[flow.key] = bands_of_predictions(three, [len(three)], [TIMES])[0]
    outcome = LearnerOutcome("tensor_sindy", (), 1.0, EMPTY, predictions=predictions)
    outcomes = {"tensor_sindy": outcome}
    found = explain(outcomes, flows, Expectation())
    assert found.verdict == "explained"
    return hold_against_unseen(found, outcomes, flows, bands, Expectation())


def test_knocks_in_a_run_held_out_refute_no_law(drawn):
    knocked = drawn["held"][0].copy()
    size = np.sqrt(np.mean(knocked**2))
    knocked[[20, 45, 60]] += size * np.array([1.0, -1.0, 0.8])
    found = judged(drawn, held=knocked)
    assert found.verdict == "explained"
    assert found.outliers["tensor_sindy"] == {"held_out/held": (20, 45, 60)}
    assert judged(drawn).outliers["tensor_sindy"] == {}
    # and excuse none that misses the rest
    assert judged(drawn, held=1.1 * knocked).verdict == "unexplained"


def test_knocks_are_told_by_the_run_they_are_in_where_another_cannot_be_predicted(drawn):
    generator, flows, predictions = np.random.default_rng(2), [], {}
    for name, knock in (("slow", None), ("fast", 30), ("held", 50)):
        record = white(drawn[name][0], 0.01, generator)
        if knock is not None:
            record[knock] *= 2.0
        rates = np.full(len(TIMES), RATES[name])
        flow = Flow(name, "training", protocol(RATES[name]), TIMES, rates, {"sigma12": record})
        flows.append(replace(flow, measured=record))
        predictions[flow.key] = {"sigma12": drawn[name][0]}
    predictions[flows[0].key] = None  # the law runs away in the first of them
    outcome = LearnerOutcome("tensor_sindy", (), 1.0, EMPTY, predictions=predictions)
    told = outliers_of(outcome, flows, Expectation())
    assert told == {flows[1].key: (30,), flows[2].key: (50,)}


def test_a_law_that_holds_in_a_run_held_out_explains(drawn):
    assert judged(drawn).verdict == "explained"


def test_a_constant_that_is_a_little_off_is_no_refutation(drawn):
    for row in drawn["held"][1:6]:
        assert judged(drawn, row).verdict == "explained"


def test_another_law_in_a_run_held_out_refutes_the_one_found(drawn):
    other = stress(RoliePoly(1.0, 0.1, 100.0), RATES["held"])
    found = judged(drawn, 0.9 * drawn["held"][0] + 0.1 * other)
    assert found.verdict == "unexplained"
    assert "runs held out are missed by" in found.lack_of_fit["tensor_sindy"].reason


def test_a_law_that_runs_away_in_a_run_held_out_is_refuted(drawn):
    gone = {**drawn, "held": np.full_like(drawn["held"], np.nan)}
    found = judged(gone, drawn["held"][0])
    assert found.verdict == "unexplained"
    assert "runs away in held" in found.lack_of_fit["tensor_sindy"].reason


def test_flows_of_which_the_truth_is_computed_do_not_judge(drawn):
    other = stress(RoliePoly(1.0, 0.1, 100.0), RATES["held"])
    assert judged(drawn, other, exact=True).verdict == "explained"


def explained_by_folds(errors, terms=ONE_TERM):
    """Return whether a law that leaves 1 % explains runs that miss by this where left out."""
    left = LackOfFit("explained", 0.01, 0.01, 0.0, 0.5)
    path = [{"held_out_by_run": dict(enumerate(errors))}]
    details = {"chosen": 0, "path": path}
    outcome = LearnerOutcome("tensor_sindy", terms, 1.0, EMPTY, details=details)
    told = hold_against_unseen(
        Explanation({"tensor_sindy": left}), {"tensor_sindy": outcome}, [], {}, Expectation()
    )
    return told.verdict == "explained"


@pytest.mark.parametrize(
    ("errors", "holds"),
    [
        ([0.011, 0.012, 0.009], True),
        # a run that alone tells a constant is missed without it, whatever the law
        ([0.011, 0.5], True),
        ([0.011, 0.012, 0.5], True),
        ([0.011, 0.2, 0.5], False),
        # the law runs away
        ([0.011, None, float("nan")], False),
        ([0.5], True),
    ],
)
def test_a_law_that_misses_most_runs_where_they_are_left_out_explains_nothing(errors, holds):
    assert explained_by_folds(errors) == holds


def test_a_law_without_a_term_has_nothing_that_runs_left_out_speak_against():
    assert explained_by_folds([0.5, 0.5, 0.5], terms=())
