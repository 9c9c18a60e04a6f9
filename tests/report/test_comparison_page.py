"""The page of a comparison: numbers that are not there, parts that cannot be drawn, verdicts."""

import html
import json
import re
from dataclasses import replace

import numpy as np
import pytest

from discover.comparison import Comparison, Flow, LearnerOutcome
from discover.comparison.judging.explanation import Explanation
from discover.comparison.judging.identifiability import Rival
from discover.comparison.judging.statements import IN_LIBRARY, Statement, no_flow_left
from discover.dataset.repeats import Repeats
from discover.learners import RecoveredTerm
from discover.protocols.control import oscillations, steady_rates
from discover.protocols.kinematics import ONLY_STATES
from discover.protocols.protocol import oscillatory_shear
from discover.report.comparison.report import write_comparison
from discover.report.comparison.tables import error_rows
from discover.report.comparison.verdict import comparison_verdict
from discover.report.parts import Missing, attempt
from discover.report.wording import (
    QUESTIONS,
    estimate,
    interval,
    percent,
    percent_range,
    significant,
    terms_text,
)
from discover.statistics import LackOfFit
from discover.statistics.residual import Expectation
from discover.study import RunFolder

NOT_THERE = (None, float("nan"), float("inf"))
TIMES = np.linspace(0.0, 10.0, 41)
ROW = {"size": 1, "support": ["sigma.sigma"], "inner": {}, "misfit": 0.02, "held_out": 0.03}


def flow(name, kind):
    protocol = oscillatory_shear(1.0, 1.0)
    stress = np.sin(TIMES)
    return Flow(
        name,
        kind,
        protocol,
        TIMES,
        np.cos(TIMES),
        {"sigma12": stress},
        stress if kind == "training" else None,
        oscillatory=True,
    )


def outcome(learner, number, predicted):
    """Return an outcome in which every number that may be missing is `number`."""
    ends = None if number is None else (number, number)
    term = RecoveredTerm("sigma.sigma", 0.2, number, ends, {"epsilon": 0.1})
    path = [{**ROW, "size": 0, "support": [], "bic": number, "misfit": 0.4}, {**ROW, "bic": number}]
    for row in path:
        row["held_out"] = number
        row["held_out_by_run"] = {"a": 0.01, "b": number, "c": 0.05}
    details = {
        "path": path,
        "selectors": {"chosen": {"bic": ["sigma.sigma"], "held_out": None or []}},
        "selection_frequency": [{"term": "sigma.sigma", "frequency": 0.5, "with_twins": 1.0}],
        "misfit": number,
        "coefficients": {"sigma": {"mean": number, "spread": number}},
        "rivals_text": "",
    }
    stresses = {q: np.sin(TIMES) for q in ("sigma12", "N1", "N2")} if predicted else None
    keys = ("training/a", "held_out/b")
    loss = (np.arange(3), np.array([1.0, np.nan, np.inf]))
    return LearnerOutcome(
        learner, (term,), 1.0, loss, details, "ended", dict.fromkeys(keys, stresses)
    )


def left(verdict, misfit=0.01, correlation=0.0):
    return LackOfFit(verdict, misfit, 0.01, correlation, 0.5, reason="made up")


def made_up(number=0.01, predicted=True, sparse="explained", network="explained", **changes):
    """Return a comparison that nothing computed."""
    flows = [flow("a", "training"), flow("b", "held_out")]
    learners = {"tensor_sindy": sparse, "tbnn_ude": network}
    learners = {name: verdict for name, verdict in learners.items() if verdict}
    rival = Rival({"sigma": 0.1}, {}, "A twin.", dict.fromkeys(("sigma12", "N1", "N2"), number))
    content = {
        "name": "made up",
        "data_summary": "none",
        "known_part": "Maxwell",
        "flows": flows,
        "before": {f.key: None for f in flows},
        "outcomes": {name: outcome(name, number, predicted) for name in learners},
        "truth": None,
        "noise": None,
        "rivals": [rival],
        "statements": [
            Statement("N1", IN_LIBRARY, "If the law is in the library, σ12 gives N1."),
            Statement("N2", "no", "No."),
        ],
        "explanation": Explanation({name: left(verdict) for name, verdict in learners.items()}),
    }
    return Comparison(**{**content, **changes})


def page_of(comparison, folder):
    write_comparison(comparison, RunFolder(folder, "x"), True)
    return html.unescape((folder / "report.html").read_text("utf-8"))


@pytest.fixture
def no_pictures(monkeypatch):
    """Leave pictures out where only words are asked for."""
    module = "discover.report.comparison.report.comparison_pictures"
    monkeypatch.setattr(module, lambda *_: ([], []))


@pytest.mark.parametrize("number", NOT_THERE[:2])
def test_a_page_is_whole_where_every_number_is_missing(number, tmp_path):
    # comparisons of measured data ended here, after minutes, in a TypeError
    page = page_of(made_up(number, predicted=False), tmp_path)
    assert "could not be drawn" not in page
    assert "(1 to 5 %; 1 of 3 not predicted)" in page
    assert "nan" not in re.sub(r"<svg.*?</svg>", "", page, flags=re.S).lower().split()
    for anchor in ("errors", "law", "selection-path", "open", "how"):
        assert f'<h2 id="{anchor}">' in page
    json.loads((tmp_path / "comparison.json").read_text("utf-8"))


@pytest.mark.parametrize("number", NOT_THERE)
def test_no_wording_fails_over_a_number_that_is_missing(number):
    assert percent(number) == "–"
    assert percent_range([number, number]) == " (2 of 2 not predicted)"
    assert percent_range([0.01, number]) == " (1 to 1 %; 1 of 2 not predicted)"
    assert interval((number, 1.0)) in ("–", "inf to 1")
    assert significant(number) in ("–", "inf")
    assert estimate(0.2, (number, 1.0)) == "0.2"


def test_percentages_that_are_there_are_given_as_before():
    # negative control of the two tests above
    assert percent_range([0.01, 0.05]) == " (1 to 5 %)"
    assert percent_range([0.01]) == percent_range(None) == ""
    assert interval((0.19, 0.21)) == "0.19 to 0.21"


def test_a_part_that_cannot_be_drawn_is_one_sentence_and_the_others_are_drawn(
    tmp_path, monkeypatch
):
    whole = page_of(made_up(), tmp_path / "whole")
    assert "could not be drawn" not in whole

    def broken(*args):
        raise TypeError("'<' not supported\nbetween instances of 'NoneType' and 'float'.")

    monkeypatch.setattr("discover.report.comparison.tables.error_rows", broken)
    monkeypatch.setattr("discover.report.comparison.pictures.selection_picture", broken)
    page = page_of(made_up(), tmp_path / "broken")
    why = "TypeError, '<' not supported between instances of 'NoneType' and 'float'."
    for part in ("The table of errors", "The picture of the selection"):
        assert f"{part} could not be drawn: {why}" in page
    assert page.count("could not be drawn") == 2
    assert page.count("<svg role") == whole.count("<svg role") - 1
    assert page.count("<table") == whole.count("<table") - 1


def test_numbers_are_written_before_the_page(tmp_path, no_pictures, monkeypatch):
    def broken(*args, **content):
        raise RuntimeError

    monkeypatch.setattr("discover.report.comparison.report.render", broken)
    with pytest.raises(RuntimeError):
        write_comparison(made_up(), RunFolder(tmp_path, "x"), True)
    assert json.loads((tmp_path / "comparison.json").read_text("utf-8"))["verdict"] == "explained"


def test_an_interruption_is_no_missing_part():
    def interrupted():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        attempt("A picture", interrupted)
    assert attempt("A picture", lambda: 1) == 1
    assert isinstance(attempt("A picture", lambda: 1 / 0), Missing)


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
    open_ = Statement("sigma12", "no", "No.", in_transients=True)
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
    statement = Statement("sigma12", "no", "No.", in_others=True)
    fitted, held_out = made_up().flows
    assert not statement.leaves_open("sigma12", fitted)
    assert not statement.leaves_open("sigma12", held_out)
    assert statement.leaves_open("sigma12", replace(fitted, kind="test"))
    assert statement.title == "σ12 in other flows"


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


def test_errors_inside_and_beyond_the_range_are_told_apart_and_so_is_a_runaway():
    # shear start-ups of a melt: the fast one could not be integrated, and was passed over
    inside = flow("b", "held_out")
    faster = replace(inside, name="fast", rate=3.0 * inside.rate)
    flows = [flow("a", "training"), inside, faster]
    comparison = made_up(flows=flows, before=dict.fromkeys(f.key for f in flows))
    wrong = {q: 1.5 * np.sin(TIMES) for q in ("sigma12", "N1", "N2")}
    outcomes = {
        name: replace(one, predictions={**one.predictions, faster.key: prediction})
        for (name, one), prediction in zip(comparison.outcomes.items(), (None, wrong), strict=True)
    }
    comparison = replace(comparison, outcomes=outcomes)
    sure = comparison_verdict(comparison)[1].lower()
    assert "σ12 by up to 0 % inside the fitted range, and σ12 by up to 50 % beyond the fit" in sure
    assert "sparse regression's stress runs away in γ̇ = cos(t), beyond the fitted range" in sure
    assert "neural network's stress runs away" not in sure
    cells = error_rows(comparison)[1]["cells"]
    assert [cell["runs_away"] for cell in cells] == [True, False, False] * 2 + [False] * 3


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


def test_a_law_as_simple_that_fits_as_well_stands_beside_the_one_found():
    # Rolie–Poly and this law have the same σ12, and the first sentence named one of them alone
    other = made_up().rivals[0]
    beside = replace(other, terms={"tr(sigma.gammadot)*I": 0.3})
    bigger = replace(other, terms={"sigma.sigma": 0.2, "gammadot.gammadot": -0.1})
    found = comparison_verdict(made_up(rivals=[beside, bigger]))[0]
    assert ", or 0.3 tr(σ·γ̇) I, which fits as well" in found
    assert "one of 2 other laws as simple" in comparison_verdict(made_up(rivals=[beside, other]))[0]
    assert "as well" not in comparison_verdict(made_up(rivals=[bigger]))[0]


def test_an_error_that_outliers_make_stands_beside_that_without_them(tmp_path, no_pictures):
    knocked = np.sin(TIMES)
    knocked[7] += 5.0
    held = replace(flow("b", "held_out"), reference={"sigma12": knocked})
    comparison = made_up(network=None, flows=[flow("a", "training"), held])
    told = replace(comparison.explanation, outliers={"tensor_sindy": {held.key: (7,)}})
    comparison = replace(comparison, explanation=told)
    # the rest is predicted exactly
    assert comparison.error_without_outliers("tensor_sindy", held) == 0.0
    whole = comparison.errors("tensor_sindy", held)["sigma12"]
    assert whole == pytest.approx(5.0 / np.linalg.norm(knocked))
    said = f"{percent(whole)} (0 % without the outlier that does not count)"
    assert said in comparison_verdict(comparison)[1]
    assert "0 % without 1 outlier" in page_of(comparison, tmp_path)
    written = json.loads((tmp_path / "comparison.json").read_text("utf-8"))
    written = written["learners"]["tensor_sindy"]["errors_without_outliers"]
    assert written == {"b": {"sigma12": 0.0, "outliers": 1}}
    clean = made_up(network=None)
    assert "without" not in comparison_verdict(clean)[1]


def test_what_may_be_a_misfit_is_not_called_noise():
    one = replace(left("unexplained", misfit=0.06, correlation=0.8), changing=0.01)
    explanation = Explanation({"tensor_sindy": one})
    found = comparison_verdict(made_up(network=None, explanation=explanation))[0]
    assert "leaves 6 %, of which 1 % changes from sample to sample, as noise does" in found
    # a noise that was given is one
    given = Explanation({"tensor_sindy": replace(one, changing=None)})
    assert "where noise is 1 %" in comparison_verdict(made_up(network=None, explanation=given))[0]


def test_a_sum_stands_in_brackets_behind_its_coefficient():
    terms = ("sigma.sigma", "sigma.gammadot+gammadot.sigma", "(exp(epsilon*tr(sigma))-1)*sigma")
    one = replace(outcome("tensor_sindy", 0.01, False), terms=tuple(
        RecoveredTerm(name, 0.2) for name in terms
    ))  # fmt: skip
    assert terms_text(one) == "0.2 σ·σ, 0.2 (σ·γ̇+γ̇·σ), 0.2 (exp(ε tr(σ))-1) σ"


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


def test_warnings_stand_in_the_verdict_and_in_json(tmp_path, no_pictures):
    said = "The members of the network <differ> by 20 % in N1."
    page = page_of(made_up(warnings=(said,)), tmp_path)
    assert f"<b>Warning.</b> {said}" in page[: page.index("<nav>")]
    content = json.loads((tmp_path / "comparison.json").read_text("utf-8"))
    assert content["warnings"] == [said]
    assert "<b>Warning.</b>" not in page_of(made_up(), tmp_path / "none")


def test_a_notebook_is_told_the_verdict_first():
    shown = made_up(sparse="unexplained")._repr_html_()
    assert shown.startswith("<p>unexplained by tensor_sindy: made up</p>")
    assert "Determined if the law is in the library: N1" in shown
