"""Every result has ``summary``, ``conf_int``, ``plot`` and a view, and says how well it fits."""

import numpy as np
import pandas as pd
import pytest
from scipy.stats import norm

import discover as dc
from discover.learners.lack_of_fit import LackOfFit
from discover.learners.results import RecoveredTerm, estimates_of
from discover.learners.settings import default_library
from discover.study import parse_study
from discover.summary_view import Estimate, SummaryView

COLUMNS = ["value", "standard_error", "low", "high", "unit"]
FEW = {"max_terms": 3}


def sparse_law_of(law, parameters):
    data = dc.synthetic_dataset(law, parameters, noise=0.01, n_samples=51)
    # none of these three terms is one of the PTT law
    library = dc.build_library(["sigma", "gammadot", "sigma.sigma"], degree=0)
    return dc.TensorSINDy(library, **FEW).fit(data)


@pytest.fixture(scope="module")
def wrong():
    return sparse_law_of("ptt_exponential", {"epsilon": 0.4})


@pytest.fixture(scope="module")
def right():
    return sparse_law_of("giesekus", {"alpha": 0.2})


def test_a_library_without_the_law_finds_no_term_and_equation_table_and_json_have_one_sign(wrong):
    for said in (repr(wrong), wrong._repr_html_(), wrong._repr_mimebundle_()["text/html"]):
        assert "the rest is systematic" in said
        assert "No term is determined" in said
    assert wrong.score(wrong.runs_) > 0.9  # which came without a word
    assert "No base was given: upper-convected Maxwell, G = 1 Pa, λ = 1 s" in wrong.text
    assert len(wrong.terms_) == 3
    assert not wrong.summary()["determined"].str.startswith("yes").any()
    assert wrong.lack_of_fit_.verdict == "unexplained"
    term = min(wrong.terms_, key=lambda one: one.coefficient)
    assert term.coefficient < 0.0  # the control: a sign that could be lost
    assert wrong.summary().loc[term.term, "value"] == term.coefficient
    assert f"− {abs(term.coefficient):.4g} {term.term}" in repr(wrong)
    latex = wrong.equation_.latex()
    assert f"- {abs(term.coefficient):.5g}" in latex
    _, _, right = latex.partition(" = ")
    assert right == r"\dot{\boldsymbol{\gamma}}"
    assert wrong.equation_.terms[[t.term for t in wrong.terms_].index(term.term)] == term.in_law


def test_a_law_in_the_library_is_said_to_fit_its_term_determined_and_every_run_drawn(right):
    """Negative control of the test above."""
    assert "Fits within the noise of" in repr(right)
    table = right.summary()
    assert list(table.columns) == [*COLUMNS, "determined"]
    assert table.loc["sigma.sigma", "determined"].startswith("yes")
    # the noise of 1 % leaves a few parts in a thousand of α
    assert table.loc["sigma.sigma", "value"] == pytest.approx(0.2, abs=0.01)
    drawing = right.plot()
    titles = [panel.get_title() for panel in drawing.axes if panel.get_visible()]
    assert len(titles) == len(right.runs_)
    assert titles[0].splitlines()[0] == right.runs_[0].name


def test_the_verdict_goes_along_in_a_file(wrong, tmp_path):
    again = dc.load(wrong.save(tmp_path / "law.discover"))
    assert repr(again) == repr(wrong)
    pd.testing.assert_frame_equal(again.summary(), wrong.summary())
    with pytest.raises(dc.InputError, match="holds no data"):
        again.plot()


def test_runs_fluids_data_sets_and_estimators_that_are_not_fitted_have_views():
    sparse = dc.TensorSINDy(max_terms=3)
    assert repr(sparse) == "TensorSINDy(max_terms=3)"
    assert "max_terms=3" in sparse._repr_html_()
    times = np.linspace(0.0, 5.0, 11)
    stress = 50.0 * (1 - np.exp(-times))
    run = dc.Run("<slow>.csv", times, dc.start_up(0.5), np.full(11, 0.5), stress)
    assert "&lt;slow&gt;.csv" in run._repr_html_()
    assert "<slow>" not in run._repr_html_()
    fluid = dc.Fluid(dc.make_law("giesekus", {"alpha": 0.2}), [100.0, 10.0], [0.1, 1.0], 2.0)
    view = fluid._repr_html_()
    assert "Giesekus" in view
    assert "22 Pa s" in view  # Σ Gλ + η_s
    assert "<slow>" not in dc.from_dataframe(run.to_dataframe())._repr_html_()


def test_intervals_of_other_levels_are_those_of_a_normal_distribution_and_no_constants_no_rows():
    class Result(SummaryView):
        def __init__(self, *estimates):
            self.estimates = estimates

        def _estimates(self):
            return list(self.estimates)

    ends = 2.0 - norm.ppf(0.975), 2.0 + 2.0 * norm.ppf(0.975)
    one, none = Result(Estimate(("a",), 2.0, ends)), Result()
    low, high = one.conf_int(0.5).loc["a"]
    assert (2.0 - low, high - 2.0) == pytest.approx((norm.ppf(0.75), 2.0 * norm.ppf(0.75)))
    assert one.summary().loc["a", "standard_error"] == pytest.approx(1.5)
    with pytest.raises(dc.InputError, match="between 0 and 1"):
        one.conf_int(95.0)
    assert none.summary().empty
    assert list(none.summary().columns) == COLUMNS
    assert list(none.conf_int().columns) == ["low", "high"]


@pytest.mark.parametrize(
    ("verdict", "ends", "rivals", "said"),
    [
        ("explained", (0.1, 0.3), [], "yes"),
        ("explained", (0.1, 0.3), [{"sigma.sigma", "sigma"}], "yes"),
        ("explained", (0.1, 0.3), [{"sigma"}], "no: a law without it"),
        ("explained", (-0.1, 0.3), [], "no: may be zero"),
        ("unexplained", (0.1, 0.3), [], "no: the law misses"),
        ("explained", None, [], "no: without interval"),
    ],
)
def test_a_term_is_determined_if_nothing_speaks_against_it(verdict, ends, rivals, said):
    left = LackOfFit(verdict, 0.01, 0.01, 0.0, 0.9)
    (one,) = estimates_of((RecoveredTerm("sigma.sigma", 0.2, ci95=ends),), left, rivals)
    assert one.notes["determined"].startswith(said)


def test_python_and_a_study_search_the_same_library():
    from discover.comparison.learning import study_library

    study = parse_study({"data": {"folder": "a"}})
    assert study_library(study) == default_library()
    assert len(default_library()) > 8  # the control: tensors alone are another library
