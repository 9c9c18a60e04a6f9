"""What the verdict of a comparison claims, and what it leaves open."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from discover.comparison.judging.band_check import unbounded
from discover.comparison.judging.explanation import Explanation
from discover.comparison.judging.statements import (
    IN_LIBRARY,
    Statement,
    no_flow_left,
)
from discover.identify.rivals.bands import PredictionBand
from made_up_comparison import TIMES, left, made_up, page_of

from discover.dataset.records.repeats import Repeats
from discover.protocols.control import oscillations, steady_rates
from discover.protocols.kinematics import ONLY_STATES
from discover.protocols.protocol import start_up
from discover.report.comparison.verdict import comparison_verdict
from discover.report.wording import QUESTIONS
from discover.statistics.residual import Expectation


def unconditional(text):
    """Return what says, without a condition, that something is determined or ruled out."""
    said = re.findall(r"[^.;]*(?:\bdetermine[sd]?\b|rule out)[^.;]*", text)
    allowed = ("not determine", "nothing is determined", "if the law is in", "do not determine")
    return [s for s in said if not any(a in s.lower() for a in allowed)]


UNEXPLAINED = [Statement("N1", "no", "No."), Statement("N2", "no", "No.")]


def test_an_unexplained_verdict_leads_and_claims_nothing(tmp_path, no_pictures):
    wrong = Explanation(
        {"tensor_sindy": left("unexplained", 0.022, 0.78), "tbnn_ude": left("unexplained", 0.1)}
    )
    comparison = made_up(explanation=wrong, statements=UNEXPLAINED)
    found, sure, following = comparison_verdict(comparison)
    assert found.startswith("Unexplained: neither law explains the data")
    assert "2.2 %" in found
    assert "correlated to 0.78" in found
    assert "no finding" in found
    assert "σ·σ" not in found  # nor a coefficient of what is none
    assert "nothing is determined" in sure
    assert "close-loop" in following
    page = page_of(comparison, tmp_path)
    assert "None of these laws explains the data" in page
    assert "would hold if the law were in the library" in page
    assert "follows from the data only if" not in page
    content = json.loads((tmp_path / "comparison.json").read_text("utf-8"))
    assert content["verdict"] == "unexplained"
    assert content["lack_of_fit"]["tensor_sindy"]["lag_one_correlation"] == 0.78
    assert content["undetermined"] == ["N1", "N2"]
    assert {s["determined"] for s in content["statements"]} == {"no"}
    assert content["learners"]["tensor_sindy"]["intervals_hold"] == "no"


def test_a_law_of_states_alone_is_fitted_and_not_tested(tmp_path, no_pictures):
    curve = steady_rates(np.linspace(0.1, 10.0, len(TIMES)))
    flows = [replace(one, protocol=curve) for one in made_up().flows]
    open_ = Statement("sigma12", "no", "No.", where="transients")
    comparison = made_up(flows=flows, statements=[open_, *UNEXPLAINED], warnings=(ONLY_STATES,))
    found, sure, following = comparison_verdict(comparison)
    assert found.startswith("Fitted, not tested: sparse regression's law and")
    assert "σ12 in transients and N1 and N2" in sure
    assert following.startswith("Measure a transient")
    assert "structure that flow breaks down" in page_of(comparison, tmp_path)


def test_a_law_of_one_run_is_fitted_and_not_tested():
    flows = made_up().flows
    found = comparison_verdict(made_up(flows=flows[:1]))[0]
    assert found.startswith("Fitted, not tested")
    assert comparison_verdict(made_up(flows=flows))[0].startswith("Explained")  # the control


@pytest.mark.parametrize(("strain", "untested"), [(0.01, True), (2.0, False)])
def test_a_sweep_at_small_strain_is_no_flow_that_a_law_could_fail_in(strain, untested):
    sweep = oscillations(np.full(len(TIMES), strain), np.geomspace(0.1, 10.0, len(TIMES)))
    one = made_up().flows[0]
    flows = [one, replace(one, name="sweep", protocol=sweep)]
    assert no_flow_left(flows, n_terms=2) == untested


def test_in_flows_that_nothing_tested_a_fitted_law_leaves_the_shear_stress_open_too():
    statement = Statement("sigma12", "no", "No.", where="others")
    fitted, held_out = made_up().flows
    assert not statement.leaves_open("sigma12", fitted)
    assert not statement.leaves_open("sigma12", held_out)
    assert statement.leaves_open("sigma12", replace(fitted, kind="test"))
    assert statement.title == "σ12 in other flows"


@pytest.mark.parametrize("ends", [True, False])
def test_where_laws_run_away_the_shear_stress_is_open_too(ends):
    fitted, held_out = made_up().flows
    held_out = replace(held_out, protocol=start_up(2.0))
    width = np.full((len(TIMES), 3), 1.0 if ends else np.inf)
    chosen = np.ones((len(TIMES), 3))
    band = PredictionBand(TIMES, chosen, -width, width, -width, width, runaways=0.5)
    narrow = replace(band, rivals_low=-chosen, rivals_high=chosen)
    said = unbounded([fitted, held_out], {fitted.key: narrow, held_out.key: band})
    assert bool(said) is not ends
    if not ends:
        assert held_out.title in said
        assert fitted.title not in said
        statement = Statement("sigma12", "no", said, where="unbounded")
        assert statement.title == "σ12 where laws run away"


def test_an_explained_verdict_is_conditional_everywhere(tmp_path, no_pictures):
    comparison = made_up()
    sentences = comparison_verdict(comparison)
    assert len(sentences) == len(QUESTIONS)
    assert sentences[0].startswith("Explained: sparse regression's law and the neural network's")
    assert "if the law is in the library, it is" in sentences[0]
    page = page_of(comparison, tmp_path)
    assert "N1: follows from the data only if the law is in the library" in page
    box = page[page.index('id="verdict"') : page.index("<nav>")]
    assert unconditional(box) == []
    content = json.loads((tmp_path / "comparison.json").read_text("utf-8"))
    assert [s["determined"] for s in content["statements"]] == [IN_LIBRARY, "no"]
    assert content["undetermined"] == ["N2"]
    # negative control of the check
    assert unconditional("N1 is determined by σ12.") != []
    assert unconditional("The data rule out every other law at 5 %.") != []


@pytest.mark.parametrize("passed", [False, True, None])
def test_a_law_for_the_fitted_range_only_says_so_in_the_first_sentence(passed):
    checks = [
        {"name": "conformation tensor positive definite", "passed": passed, "where": "run a"},
        {"name": "integrates beyond training", "passed": passed, "where": "run b"},
    ]
    comparison = made_up(network=None)
    sparse = replace(comparison.outcomes["tensor_sindy"], physics={"checks": checks})
    found = comparison_verdict(replace(comparison, outcomes={"tensor_sindy": sparse}))[0]
    limited = "loses positive definiteness in run a and whose stress runs away in run b" in found
    assert limited == ("is for the fitted range only" in found) == (passed is False)
    # also where it explains nothing: it may still be used as a description of the runs
    left = comparison.explanation.lack_of_fit["tensor_sindy"].refuted("it misses them")
    unexplained = replace(comparison.explanation, lack_of_fit={"tensor_sindy": left})
    outcomes = {"tensor_sindy": sparse}
    found = comparison_verdict(replace(comparison, outcomes=outcomes, explanation=unexplained))[0]
    assert found.startswith("Unexplained")
    assert ("is for the fitted range only" in found) == (passed is False)


def test_what_is_taken_for_error_is_told_with_its_source_where_nobody_told_the_noise():
    comparison = made_up(noise=None)
    told = replace(
        comparison.explanation,
        expectation=Expectation(None, 0.017, 0.03),
        repeats=Repeats((("a", "b"),), 0.03),
    )
    sure = comparison_verdict(replace(comparison, explanation=told))[1]
    assert "1.7 % that the modes miss their own sweep by" in sure
    assert "3 % that repeated runs differ by" in sure
    given = replace(told, expectation=Expectation(0.02, 0.017))
    assert (
        "nobody told" not in comparison_verdict(replace(comparison, explanation=given))[1].lower()
    )


def test_what_may_be_a_misfit_is_not_called_noise():
    one = replace(left("unexplained", misfit=0.06, correlation=0.8), changing=0.01)
    explanation = Explanation({"tensor_sindy": one})
    found = comparison_verdict(made_up(network=None, explanation=explanation))[0]
    assert "leaves 6 %, of which 1 % changes from sample to sample, as noise does" in found
    # a noise that was given is one
    given = Explanation({"tensor_sindy": replace(one, changing=None)})
    assert "where noise is 1 %" in comparison_verdict(made_up(network=None, explanation=given))[0]


def test_where_only_the_network_explains_nothing_is_determined():
    comparison = made_up(sparse="unexplained", statements=UNEXPLAINED)
    found, sure, _ = comparison_verdict(comparison)
    assert comparison.verdict == "explained"
    assert found.startswith("Explained: the neural network's law explains the data")
    assert "sparse regression's law leaves" in found
    assert "nothing is determined" in sure


def test_a_network_alone_that_explains_nothing_is_no_reason_to_measure_more():
    comparison = made_up(sparse=None, network="unexplained", statements=UNEXPLAINED)
    found, _, following = comparison_verdict(comparison)
    assert found.startswith("Unexplained: the law does not explain the data")
    assert "close-loop" in following


def test_no_signal_reports_no_law(tmp_path, no_pictures):
    comparison = made_up(sparse="no_signal", network=None, statements=UNEXPLAINED)
    comparison = replace(
        comparison, outcomes={n: replace(o, terms=()) for n, o in comparison.outcomes.items()}
    )
    assert comparison_verdict(comparison)[0].startswith("No signal")
    page = page_of(comparison, tmp_path)
    assert "no law is reported" in page
    content = json.loads((tmp_path / "comparison.json").read_text("utf-8"))
    assert content["verdict"] == "no_signal"
    assert content["learners"]["tensor_sindy"]["terms"] == []
