"""The page of a comparison: numbers that are not there, parts that cannot be drawn, and errors."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from made_up_comparison import NOT_THERE, TIMES, flow, made_up, outcome, page_of, posterior

from discover.learners import RecoveredTerm
from discover.loop import ErrorPair
from discover.loop.parts import Explanation, Explanations
from discover.report.comparison.report import write_comparison
from discover.report.comparison.tables import error_rows, learner_lines
from discover.report.page import Missing, attempt
from discover.report.wording import percent, percent_range, terms_text
from discover.study import RunFolder
from discover.words import estimate, interval, significant


@pytest.mark.parametrize("number", NOT_THERE[:2])
def test_a_page_is_whole_where_every_number_is_missing(number, tmp_path):
    # comparisons of measured data ended here, after minutes, in a TypeError
    page = page_of(made_up(number, predicted=False), tmp_path)
    assert "could not be drawn" not in page
    assert "nan" not in re.sub(r"<svg.*?</svg>", "", page, flags=re.S).lower().split()
    for anchor in ("errors", "law", "open", "how"):
        assert f'<h2 id="{anchor}">' in page
    json.loads((tmp_path / "comparison.json").read_text("utf-8"))


@pytest.mark.parametrize("number", NOT_THERE)
def test_no_wording_fails_over_a_number_that_is_missing(number):
    # numbers that are there: test_wording.py
    assert percent(number) == "–"
    assert percent_range([number, number]) == " (2 of 2 not predicted)"
    assert percent_range([0.01, number]) == " (1 of 2 not predicted)"
    assert interval((number, 1.0)) in ("–", "inf to 1")
    assert significant(number) in ("–", "inf")
    assert estimate(0.2, (number, 1.0)) == "0.2"


def told_of_terms(verdict, network_share, *sets):
    """Return what a summary says of σ·σ of either learner, for a posterior over sets of effects."""
    pair = ErrorPair(0.01, 0.01)
    share = 1.0 / max(len(sets), 1)
    likely = tuple(Explanation(effects, share, pair, {}) for effects in sets)
    result = replace(posterior(verdict, 0.01), explanations=Explanations(likely, 0.0))
    bare = {name: outcome(name, 0.2, True) for name in ("tensor_sindy", "tbnn_ude")}
    shares = {"tensor_sindy": 0.9, "tbnn_ude": network_share}
    found = made_up(outcomes=bare, posterior=result, shares=shares, rivals=[])
    return found.summary()["determined"].drop("answer", errors="ignore").droplevel(1)


GIESEKUS, SLIP = ("giesekus_mobility",), ("giesekus_mobility", "wall_slip")


@pytest.mark.parametrize(
    ("arguments", "sparse", "network"),
    [
        (("explained", 0.9, GIESEKUS, SLIP), "yes", "yes"),
        # a network fits by a function of its own, whatever its projection does
        (("explained", 0.0, GIESEKUS, SLIP), "yes", "no: the law of these terms is not among"),
        (("explained", 0.9, GIESEKUS, ("ptt_linear",)), "no: a law without", "no: a law without"),
        # each learner may describe the runs as far as it can see where the posterior does not
        (("unexplained", 0.9, GIESEKUS), "no: no law describes", "no: no law describes"),
    ],
)
def test_a_term_is_determined_only_if_every_likely_law_has_it(arguments, sparse, network):
    told = told_of_terms(*arguments)
    assert told["tensor_sindy"].startswith(sparse)
    assert told["tbnn_ude"].startswith(network)


def test_a_part_that_cannot_be_drawn_is_one_sentence_beside_the_others(tmp_path, monkeypatch):
    whole = page_of(made_up(), tmp_path / "whole")
    assert "could not be drawn" not in whole

    def broken(*args):
        raise TypeError("'<' not supported\nbetween instances of 'NoneType' and 'float'.")

    monkeypatch.setattr("discover.report.comparison.tables.error_rows", broken)
    monkeypatch.setattr("discover.report.comparison.report.training_picture", broken)
    page = page_of(made_up(), tmp_path / "broken")
    why = "TypeError, '<' not supported between instances of 'NoneType' and 'float'."
    for part in ("The table of errors", "The picture of the training runs"):
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
    sparse, network = learner_lines(comparison)
    assert "Sparse regression diverges in γ̇ = cos(t)" in sparse
    assert "diverges" not in network
    near, far = error_rows(comparison)
    assert near["range"] == "inside the fitted range"
    assert far["range"].startswith("beyond the fitted range")
    cells = far["cells"]
    assert [cell["runs_away"] for cell in cells] == [True, False, False] * 2 + [False] * 3


def test_a_sum_stands_in_brackets_behind_its_coefficient():
    names = ("sigma.sigma", "sigma.gammadot+gammadot.sigma", "(exp(epsilon*tr(sigma))-1)*sigma")
    terms = tuple(RecoveredTerm(name, 0.2) for name in names)
    said = "0.2 σ·σ, 0.2 (σ·γ̇+γ̇·σ), 0.2 (exp(ε tr(σ))-1) σ"
    assert terms_text(replace(outcome("tensor_sindy", 0.01, False), terms=terms)) == said


def test_a_notebook_is_told_the_verdict_first():
    comparison = made_up(sparse="unexplained")
    shown = comparison._repr_html_()
    assert shown.startswith(f"<p>{comparison.answer.headline}</p>")
    assert "<p>tensor_sindy: Describes the fitted runs to 1 %; the rest is systematic" in shown
    assert "Determined if the law is in the library: N1" in shown
