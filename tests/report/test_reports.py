"""Reports: what they contain, that they stand alone, that names are escaped."""

import json
import re
import subprocess
import sys
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from discover.closed_loop import CandidateScore
from discover.closed_loop.result import (
    ErrorPair,
    Fold,
    LoopResult,
    RunRecord,
    Stage,
    StageParameter,
)
from discover.comparison import compare
from discover.comparison.outcome import LearnerOutcome
from discover.equations.mathml import law_element, term_element
from discover.learners.result import LearnerResult, RecoveredTerm
from discover.report.comparison_report import comparison_pictures, safe_name, write_comparison
from discover.report.loop_report import write_loop
from discover.report.mathtext import formula
from discover.report.plots.flows import curves
from discover.report.plots.selection import selection_picture
from discover.report.plots.studies import third_harmonic
from discover.report.wording import (
    comparison_verdict,
    interval,
    percent,
    selection_sentence,
    significant,
    spoken,
)
from discover.study import RunFolder, parse_study
from tensor_library.library import build_library


def trained(learner, study, model, runs, seed=0, progress=None):
    from discover.laws import Fluid, make_law

    law = make_law("giesekus", {"alpha": 0.2})
    history = (np.arange(1, 3), np.array([1.0, 0.1]))
    term = RecoveredTerm("sigma.sigma", 0.2, 0.19, (0.199, 0.201), {}, r"\sigma\cdot\sigma")
    message = "ended <b>well</b>"
    return LearnerResult(learner, law, (term,), 1.0, history, {}, message), Fluid.dimensionless(law)


@pytest.fixture(scope="module")
def comparison():
    study = parse_study(
        {
            "data": {"synthetic": {"law": "giesekus", "parameters": {"alpha": 0.2}, "samples": 21}},
            "compare": {
                "high_deborah": [1.5, 6.0],
                "library": {"degree": 0},
                "sweep": {"laws": ["ptt_linear"], "parameter": "epsilon", "values": [0.1]},
            },
        }
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("discover.comparison.run_comparison.train", trained)
        return replace(compare(study), name="<script>alert(1)</script>")


@pytest.fixture(scope="module")
def page(comparison, tmp_path_factory):
    folder = RunFolder(tmp_path_factory.mktemp("report"), "x")
    return write_comparison(comparison, folder, True, "[data] # <img src=x>").read_text("utf-8")


def stands_alone(text):
    outside = re.findall(r"""(?:src|href)\s*=\s*["'](?!#)([^"']*)""", text)
    return (
        not outside and "url(http" not in text and "@import" not in text and "<script" not in text
    )


def test_the_page_stands_alone_and_escapes_names(page):
    assert stands_alone(page)
    assert "&lt;script&gt;alert(1)" in page
    assert "&lt;img src=x&gt;" in page
    assert "<b>well</b>" not in page


def test_a_page_that_needs_the_network_is_told_from_one_that_does_not():
    # negative control of the check above
    assert not stands_alone('<img src="https://example.org/a.png">')
    assert not stands_alone("<script>1</script>")


def test_identifiers_are_unique(page):
    identifiers = re.findall(r'\bid="([^"]+)"', page)
    assert len(identifiers) == len(set(identifiers))
    references = re.findall(r"url\(#([^)]+)\)", page) + re.findall(r'href="#([^"]+)"', page)
    assert set(references) <= set(identifiers)


def test_the_page_has_the_papers_pictures_and_tables(page):
    names = ("flow_laos_3_1.5", "flow_laos_2_1", "flow_startup_2", "high_deborah", "loss", "sweep")
    for name in (*names, "training"):
        assert f'<figure id="{name}">' in page
    for text in ("penalised", "debiased", "95 % interval", "σ₁₂", "N₂", "not determined"):
        assert text in page
    assert "prefers-color-scheme: dark" in page


def test_every_picture_is_well_formed_and_names_every_curve(comparison):
    pictures, training = comparison_pictures(comparison)
    for picture in [*pictures, *training]:
        ElementTree.fromstring(picture.svg.split("?>", 1)[1].split(">", 1)[1])
        assert picture.caption
    for picture in pictures[:3]:
        for label in ("truth", "before", "sparse regression", "neural network", "N₁", "σ₁₂"):
            assert label in picture.svg


def test_pictures_are_the_same_bytes_every_time(comparison):
    first, second = (comparison_pictures(comparison)[0][0].svg for _ in range(2))
    assert first == second


PATH = [
    {"size": 0, "support": [], "inner": {}, "misfit": 0.4, "held_out": 0.4, "bic": 900.0},
    {
        "size": 1,
        "support": ["sigma.sigma"],
        "inner": {},
        "misfit": 0.02,
        "held_out": 0.02,
        "bic": 0.0,
    },
]
SELECTORS = {"chosen": {"bic": ["sigma.sigma"], "stability": []}, "agree": False}
FREQUENCY = [{"term": "sigma.sigma", "frequency": 0.5, "with_twins": 1.0}]


def test_the_selection_path_shows_its_rules_and_their_disagreement():
    details = {"path": PATH, "selectors": SELECTORS, "selection_frequency": FREQUENCY}
    drawn = selection_picture(details)
    assert drawn is not None
    for label in ("chosen by BIC", "chosen by stability", "σ·σ", "runs left out"):
        assert label in drawn.svg
    outcome = LearnerOutcome("tensor_sindy", (), 1.0, (np.ones(1), np.ones(1)), details)
    assert selection_sentence(outcome) == "The rules disagree. BIC: σ·σ; stability: no term."
    assert selection_picture({"path": PATH[:1]}) is None


def test_a_curve_that_ran_away_is_left_out(comparison):
    flow = comparison.judged[0]
    outcome = comparison.outcomes["tbnn_ude"]
    lost = replace(outcome, predictions={**outcome.predictions, flow.key: None})
    without = replace(comparison, outcomes={**comparison.outcomes, "tbnn_ude": lost})
    labels = [label for label, _, _ in curves(without, flow)]
    assert "neural network" not in labels
    assert "sparse regression" in labels
    comparison_pictures(without)


def test_the_verdict_says_what_was_found_and_what_is_not_known(comparison):
    text = " ".join(comparison_verdict(comparison))
    assert "exactly the terms" in text
    assert "Not determined by these data: N2" in text
    wrong = replace(comparison, truth=())
    assert "too many: σ·σ" in " ".join(comparison_verdict(wrong))


def test_an_ellipse_has_no_third_harmonic_and_a_distorted_wave_has():
    phase = np.linspace(0.0, 2.0 * np.pi, 121)
    assert third_harmonic(np.cos(phase + 0.3)) < 1e-12
    assert third_harmonic(np.cos(phase) + 0.1 * np.cos(3 * phase)) == pytest.approx(0.1)


def test_every_term_typesets_as_well_formed_mathml():
    for term in build_library(degree=2, closed_forms=("exp", "saturating")).terms:
        ElementTree.fromstring(term_element(term.name, {"epsilon": 0.1}))
    terms = [RecoveredTerm("sigma", 1.0), RecoveredTerm("sigma.sigma", -1e-7)]
    law = law_element(terms, False)
    ElementTree.fromstring(law)
    assert "<mn>-7</mn>" in law


def test_numbers_keep_what_tells_them_apart():
    assert interval((0.20001, 0.20002)) == "0.20001 to 0.20002"
    assert percent(None) == significant(None) == interval(None) == "–"
    assert percent(0.1234) == "12 %"
    assert significant(-0.5) == "−0.5"


def test_file_names_stay_in_the_folder():
    assert "/" not in safe_name("../../etc/passwd")
    assert safe_name("flow_laos_3_1.5") == "flow_laos_3_1.5"


def test_a_formula_that_cannot_be_set_is_shown_as_text():
    assert formula(r"\alpha\,\sigma", "a").startswith("<svg")
    assert formula(r"\nonsense{<b>}", "b") == r"<code>\nonsense{&lt;b&gt;}</code>"


def loop_result(held_out=0.2):
    time = np.geomspace(0.01, 10.0, 40)
    rate = np.ones(40)
    records = []
    for name, held in ((r"a<b>$\frac$.csv", False), ("c.csv", True)):
        measured = 1.0 - np.exp(-time)
        predicted = np.stack([1.4 * measured, 1.01 * measured])
        errors = np.array([0.4, 0.01])
        records.append(RunRecord(name, held, time, time, time, rate, measured, predicted, errors))
    stage = Stage(
        "stress_gain",
        "signal",
        {"gain": StageParameter(0.7, (0.69, 0.71), "")},
        ("rate_gain",),
        ErrorPair(0.01, held_out),
        50.0,
        r"\sigma \mathrel{+}= g\,\sigma",
        "a source",
        "a check",
    )
    candidate = CandidateScore(
        effect="stress_gain", kind="signal", score=0.9, step=0.1, reduction=0.95, error=0.01,
        left_out_error=None, aliases=("rate_gain",), evidence=50.0,
    )  # fmt: skip
    return LoopResult(
        "effects_added", ErrorPair(0.4, 0.4), ErrorPair(0.01, held_out), 0.005, (stage,),
        {"structured": False, "runs": ["a"]}, ((candidate,), (candidate,)), tuple(records),
    )  # fmt: skip


def test_the_loop_report_holds_data_residual_ranking_and_errors(tmp_path):
    folder = RunFolder(tmp_path, "x")
    page = write_loop(loop_result(), folder, "<i>name", "data", "").read_text("utf-8")
    assert stands_alone(page)
    assert "<i>name" not in page
    assert r"a&lt;b&gt;$\frac$.csv" in page
    for name in ("waterfall", "runs", "residual", "reading", "run_errors", "ranking"):
        assert f'<figure id="{name}">' in page
        assert (tmp_path / "figures" / f"{name}.svg").is_file()
    for text in ("cannot tell it from", "rate_gain", "held-out runs", "gain", "0.69 to 0.71"):
        assert text in page
    assert (tmp_path / "loop.json").is_file()
    assert r"\begin{equation}" in (tmp_path / "equations.tex").read_text()


def test_a_loop_without_held_out_runs_or_effects_still_reports(tmp_path):
    result = replace(
        loop_result(), stages=(), error_before=ErrorPair(0.01, None),
        error_after=ErrorPair(0.01, None), verdict="no_effect_needed", rankings=(),
    )  # fmt: skip
    page = write_loop(result, RunFolder(tmp_path, "x"), "n", "d").read_text("utf-8")
    assert "no effect earned its place" in page


def test_the_loop_report_shows_runs_held_out_in_turn_and_constants_with_units(tmp_path):
    result = replace(
        loop_result(),
        folds=(Fold("only.csv", "unexplained", ("tr(sigma)*sigma",), 0.7, 0.123),),
        declared_parameters={"modulus_Pa": StageParameter(41.5, (41.0, 42.0), "Pa")},
    )
    page = write_loop(result, RunFolder(tmp_path, "x"), "n", "d").read_text("utf-8")
    for text in ("by a search that did not see it", "only.csv", "12 %", "tr(σ) σ"):
        assert text in page
    declared = page[page.index('<table id="declared"') :]
    row = declared[: declared.index("</table>")]
    assert all(text in row for text in ("modulus_Pa", "41.5", "41 to 42", ">Pa<"))
    contents = json.loads((tmp_path / "loop.json").read_text())
    assert contents["folds"][0]["effects"] == ["tr(sigma)*sigma"]
    assert contents["declared_parameters"]["modulus_Pa"]["unit"] == "Pa"


def test_a_comparison_shows_itself_as_tables(comparison):
    terms, errors = comparison.terms_table(), comparison.errors_table()
    assert terms.loc["sigma.sigma", ["truth", "tensor_sindy"]].tolist() == [0.2, 0.2]
    flow = comparison.judged[0].name
    wanted = comparison.errors("before", comparison.judged[0])["N1"]
    assert errors.loc[(flow, "N1"), "before"] == wanted
    assert errors.loc[(flow, "N1"), "tensor_sindy"] < wanted
    shown = comparison._repr_html_()
    assert "<table" in shown
    for statement in comparison.statements:
        assert statement.quantity in shown
    rivals = comparison.rivals_table()
    assert len(rivals) == len(comparison.rivals)
    assert set(rivals.columns) >= {"law", "told_by"} or not len(rivals)


def test_a_loop_shows_itself_as_tables():
    result = loop_result()
    line = result.table().iloc[0]
    assert (line["effect"], line["value"], line["low"], line["high"]) == (
        "stress_gain", 0.7, 0.69, 0.71,
    )  # fmt: skip
    assert result.ranking_table(1)["score"].tolist() == [0.9]
    runs = result.runs_table()
    assert runs.index.tolist() == [record.name for record in result.records]
    for record in result.records:
        assert runs.loc[record.name, "declared"] == record.errors[0]
    assert result.errors_table().loc["after", "fit"] == result.error_after.fit
    assert "stress_gain" in result._repr_html_()
    assert "effects_added" in replace(result, stages=())._repr_html_()


def test_words_with_terms_in_them_keep_their_full_stops_and_decimal_points():
    said = spoken("0.5 tr(sigma.gammadot)*I + sigma.sigma, whatever the law.")
    assert said == "0.5 tr(σ·γ̇) I + σ·σ, whatever the law."


def test_reports_leave_a_notebook_its_pictures():
    """Reports once changed matplotlib's backend, and a notebook showed no picture from then on."""
    code = "import matplotlib; matplotlib.use('agg'); import discover.report.comparison_report; "
    code += "import discover.report.loop_report, discover.report.mathtext as m, sys; "
    code += "assert '<svg' in m.formula('x^2', 'a'); print(matplotlib.get_backend()); "
    code += "print('matplotlib.pyplot' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["agg", "False"]
