"""What a learner hands on shows itself: as SymPy, LaTeX, table and in a notebook."""

import jax.numpy as jnp
import numpy as np
import sympy

from discover.laws.expansion import law_of_terms
from discover.laws.textbook.classical import Giesekus
from discover.learners import LearnerResult, RecoveredTerm
from tensor_library.law_terms import LawTerms
from tensor_library.sympy_notation import STRESS, Trace

EXPONENTIAL = "(exp(epsilon*tr(sigma))-1)*sigma"


def result(base=None):
    terms = (
        RecoveredTerm("sigma.sigma", 0.25, coefficient_penalised=0.24, ci95=(0.2, 0.3)),
        RecoveredTerm(EXPONENTIAL, 1.0, inner={"epsilon": 0.5}),
    )
    law = law_of_terms(LawTerms.of(terms), True, base)
    return LearnerResult("tensor_sindy", law, terms, 1.0, {}, "ended <b>well</b>")


def test_the_sympy_form_is_the_extra_term():
    wanted = 0.25 * STRESS**2 + (sympy.exp(0.5 * Trace(STRESS)) - 1) * STRESS
    assert sympy.expand(result().sympy() - wanted) == 0


def test_the_table_has_a_line_for_each_term_with_its_interval():
    table = result().table()
    assert table["term"].tolist() == ["sigma.sigma", EXPONENTIAL]
    assert table.loc[0, ["low", "high"]].tolist() == [0.2, 0.3]
    assert np.isnan(table.loc[1, "low"])
    assert table.loc[1, "inner"] == "epsilon = 0.5"


def test_a_notebook_shows_equation_and_table_and_escapes_text():
    shown = result()._repr_html_()
    assert "<math" in shown
    assert "<table" in shown
    assert "<b>well</b>" not in shown
    assert r"\epsilon = 0.5" in result().latex()


def test_the_equation_holds_the_known_law_below():
    equation = result(Giesekus(0.1)).equation()
    found = {t.term: t.coefficient for t in equation.terms}
    assert abs(found["sigma.sigma"] - 0.35) < 1e-12
    stress, rate = jnp.asarray([0.3, 0.1, -0.1, 0.5]), jnp.asarray([0.0, 0.0, 0.0, 1.0])
    np.testing.assert_allclose(
        equation.law().extra_term(stress, rate),
        result(Giesekus(0.1)).law.extra_term(stress, rate),
        rtol=1e-12,
    )
