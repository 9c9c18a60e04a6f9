"""Results in a notebook: every one shows its sentences, law and tables, and escapes its text."""

import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest
import sympy

from discover.comparison import LearnerOutcome
from discover.equations import Box, Equation
from discover.equations import Tested as WhereTested
from discover.identify import Difference, Structure, Twin
from discover.identify.structure import QuantityVerdict
from discover.laws.expansion import law_of_terms
from discover.laws.textbook.classical import Giesekus
from discover.learners import LearnerResult, RecoveredTerm
from discover.summary_view import NotebookView, as_html, table_of
from tensor_library import LawTerm
from tensor_library.law_terms import LawTerms
from tensor_library.sympy_notation import STRESS, Trace

LAW = LawTerms({"sigma.sigma": 0.2, "gammadot": -0.01})


class Spoken(NotebookView):
    def _shown(self):
        yield "1 < 2"
        yield ""
        yield pd.DataFrame({"x": ["<b>"], "y": [None]})


def test_parts_are_shown_in_order_and_escaped_and_a_counted_index_is_not_shown():
    shown = Spoken()._repr_html_()
    assert shown.startswith("<p>1 &lt; 2</p><table")
    assert "&lt;b&gt;" in shown
    assert "<th>y</th>" not in shown  # nothing in that column
    assert as_html(Spoken()) == shown
    assert as_html(pd.DataFrame()) == ""
    counted = pd.DataFrame({"x": [1.0, np.nan]})
    assert "<th>1</th>" not in as_html(counted)
    assert "–" in as_html(counted)
    assert "before" in as_html(pd.DataFrame({"x": [1.0]}, index=["before"]))


STRUCTURE = Structure(
    LAW, 8, (), (QuantityVerdict("N2", "undetermined", "N2 is <not> determined."),)
)
TWIN = Twin(LAW, "series", True, Difference(0.0, 0.0, 0.2))


@pytest.mark.parametrize(
    ("result", "words"),
    [
        (TWIN, ["0.2 sigma.sigma − 0.01 gammadot gives the same σ12 and the same N1"]),
        (STRUCTURE, ["0 combinations of the 8 coefficients", "N2 is &lt;not&gt; determined."]),
    ],
    ids=lambda x: type(x).__name__,
)
def test_what_was_found_out_about_a_law_shows_itself(result, words):
    shown = result._repr_html_()
    for word in words:
        assert word in shown


def test_lists_become_tables_and_an_equation_shows_modes_and_where_it_was_tested():
    assert table_of([TWIN]).loc[0, ["proof", "N2_apart"]].tolist() == ["series", 0.2]
    assert table_of([]).empty
    tested = WhereTested(Box((1.0, 2.0), (0.25, 1.0)), None)
    terms = (LawTerm("sigma.sigma", 0.2),)
    shown = Equation(terms, (120.0, 30.0), (0.7, 2.5), tested=tested)._repr_html_()
    assert "<math" in shown
    assert "<th>G_Pa</th>" in shown
    assert "Learned in Wi 1 to 2, De 0.25 to 1." in shown
    # a dimensionless law has no modes to speak of
    assert "G_Pa" not in Equation(terms)._repr_html_()


PATH = [
    {"size": 0, "support": [], "misfit": 0.3, "held_out": 0.4, "log_evidence": -10.0},
    {"size": 1, "support": ["sigma.sigma"], "misfit": 0.02, "held_out": None, "log_evidence": 90.0},
]


def outcome(**details):
    term = RecoveredTerm("sigma.sigma", 0.2, ci95=(0.19, 0.21))
    return LearnerOutcome("tensor_sindy", (term,), 1.0, details, "ended")


def test_the_path_has_the_best_law_of_each_size_and_a_learner_without_one_empty_tables():
    table = outcome(path=PATH).path_table()
    assert table["terms"].tolist() == ["no term", "sigma.sigma"]
    likely = outcome(inclusion={"sigma.sigma": 0.9})
    assert likely.inclusion_table()["probability"].tolist() == [0.9]
    without = outcome()
    for table in (without.path_table(), without.inclusion_table()):
        assert table.empty
    assert "sigma.sigma" in without._repr_html_()


EXPONENTIAL = "(exp(epsilon*tr(sigma))-1)*sigma"


def learned(base=None):
    terms = (
        RecoveredTerm("sigma.sigma", 0.25, coefficient_penalised=0.24, ci95=(0.2, 0.3)),
        RecoveredTerm(EXPONENTIAL, 1.0, inner={"epsilon": 0.5}),
    )
    law = law_of_terms(LawTerms.of(terms), True, base)
    return LearnerResult("tensor_sindy", law, terms, 1.0, {}, "ended <b>well</b>")


def test_a_result_is_the_extra_term_a_table_with_intervals_and_an_escaped_view():
    wanted = 0.25 * STRESS**2 + (sympy.exp(0.5 * Trace(STRESS)) - 1) * STRESS
    assert sympy.expand(learned().sympy() - wanted) == 0
    table = learned().table()
    assert table["term"].tolist() == ["sigma.sigma", EXPONENTIAL]
    assert table.loc[0, ["low", "high"]].tolist() == [0.2, 0.3]
    assert np.isnan(table.loc[1, "low"])
    assert table.loc[1, "inner"] == "epsilon = 0.5"
    shown = learned()._repr_html_()
    assert "<math" in shown
    assert "<table" in shown
    assert "<b>well</b>" not in shown
    assert r"\epsilon = 0.5" in learned().latex()


def test_the_equation_holds_the_known_law_below():
    equation = learned(Giesekus(0.1)).equation()
    found = {t.term: t.coefficient for t in equation.terms}
    assert abs(found["sigma.sigma"] - 0.35) < 1e-12
    stress, rate = jnp.asarray([0.3, 0.1, -0.1, 0.5]), jnp.asarray([0.0, 0.0, 0.0, 1.0])
    np.testing.assert_allclose(
        equation.law().extra_term(stress, rate),
        learned(Giesekus(0.1)).law.extra_term(stress, rate),
        rtol=1e-12,
    )
