"""Terms, laws and effects are set as formulas, and read as text."""

from xml.etree import ElementTree

import pytest

from discover.effects import library_effects, named_effects
from discover.effects.library_term import library_term
from discover.equations.spelling.markup import law_element, term_element
from discover.learners import RecoveredTerm
from discover.report.mathtext import formula, plain
from discover.words import readable
from tensor_library.library import build_library
from tensor_library.terms import parse_term


def test_every_term_typesets_as_well_formed_mathml():
    for term in build_library(degree=2, closed_forms=("exp", "saturating")).terms:
        ElementTree.fromstring(term_element(term.name, {"epsilon": 0.1}))
    terms = [RecoveredTerm("sigma", 1.0), RecoveredTerm("sigma.sigma", -1e-7)]
    law = law_element(terms, False)
    ElementTree.fromstring(law)
    assert "<mn>-7</mn>" in law


def test_a_formula_that_cannot_be_set_is_shown_as_text():
    assert formula(r"\alpha\,\sigma", "a").startswith("<svg")
    assert formula(r"\nonsense{<b>}", "b") == "<code>nonsense&lt;b&gt;</code>"


@pytest.mark.parametrize(
    "effect",
    [
        *named_effects().values(),
        *library_effects()[:3],
        library_term(parse_term("tr(sigma)^2*(sigma.gammadot+gammadot.sigma)")),
    ],
    ids=lambda e: e.name,
)
def test_every_effect_is_set_as_a_formula_and_no_latex_is_left_of_it(effect):
    for latex in (effect.equation, *(parameter.symbol for parameter in effect.parameters)):
        drawn = formula(latex, "a")
        assert drawn.startswith("<svg")
        assert "\\" not in drawn
        assert not set(plain(latex)) & set("\\{}$")


def test_a_formula_is_read_aloud_as_it_is_written():
    assert plain(r"\sigma \mathrel{+}= \frac{Y}{t_\mathrm{b}}\,\dot\gamma") == "σ += Y/(t_b) γ̇"
    assert (
        plain(r"h - (e^{\varepsilon\,\mathrm{tr}\,\boldsymbol{\sigma}} - 1)")
        == "h - (e^(ε tr σ) - 1)"
    )


def test_words_with_terms_in_them_keep_their_full_stops_and_decimal_points():
    said = readable("0.5 tr(sigma.gammadot)*I + sigma.sigma, whatever the law.")
    assert said == "0.5 tr(σ·γ̇) I + σ·σ, whatever the law."
