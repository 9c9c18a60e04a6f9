"""What the equations of pages show is the LaTeX that `test_latex_spelling` reads."""

import xml.etree.ElementTree as ElementTree

import pytest
from spelled_laws import BOTH_SIGNS, LIBRARY, sum_of

from discover.equations.parts import NamedPart
from discover.equations.spelling.markup import (
    SEPARATOR,
    law_element,
    law_latex,
    sum_elements,
    term_element,
)
from discover.laws import LAWS
from tensor_library import LawTerm


def elements(markup, tag="math"):
    return list(ElementTree.fromstring(f"<div>{markup}</div>").iter(tag))


def drawn(markup):
    return "".join(text for one in elements(markup) for text in one.itertext())


@pytest.mark.parametrize("name", BOTH_SIGNS)
def test_what_a_page_shows_is_the_latex_of_the_law(name):
    equation = BOTH_SIGNS[name].equation
    law = law_element(equation.terms, True, equation.named)
    text = " ".join(one.get("alttext") for one in elements(law)).replace(r", \quad ", SEPARATOR)
    shown = {r"\textbf{γ̇}": r"\dot{\boldsymbol{\gamma}}", "α": r"\alpha", "ε": r"\epsilon"}
    for letter, written in (shown | {"κ": r"\kappa", "ξ": r"\xi"}).items():
        text = text.replace(letter, written)
    assert text == law_latex(equation.terms, True, 4, equation.named)


@pytest.mark.parametrize("name", [name for name, law in LAWS.items() if law.written])
def test_every_named_law_is_drawn_without_a_command_of_latex(name):
    constants = {key: low + 0.3 * (min(high, 10.0) - low)
                 for key, (low, high) in LAWS[name].parameters.items()}  # fmt: skip
    law = law_element((), True, NamedPart(name, (constants,)), modes=2, solvent=True)
    assert "\\" not in drawn(law)
    assert "xmlns" not in law  # an address, in a page that asks for none
    # a text of several letters is a function's: a name would be as long as the others are short
    assert {one.text for one in elements(law, "mi") if len(one.text) > 1} <= {"tr", "max"}


def test_every_tensor_is_bold_and_upright():
    for term in LIBRARY.terms:
        parts = [one for tag in ("mi", "mtext") for one in elements(term_element(term.name), tag)]
        tensors = [one for one in parts if one.text in ("σ", "γ̇", "I")]
        assert tensors
        # browsers take no other variant, and draw what they do not take as if it were not there
        assert {one.get("mathvariant") for one in tensors} == {"normal"}
        assert {one.get("style") for one in tensors} == {"font-weight:bold"}


def test_a_long_law_can_break_between_its_summands():
    terms = sum_of([5, 6], [0.2, 0.1]).equation.terms
    # browsers break a line between elements, never within one
    assert law_element(terms, True).count("</math><wbr/><math") == len(terms)


def test_a_sign_between_summands_is_spaced_as_one_and_a_first_one_is_not():
    terms = [LawTerm("sigma", -1.0), LawTerm("sigma.sigma", -1.5e-5)]
    first, second = elements(sum_elements(terms))
    # a sign is a prefix where it is the first of several in its row
    assert first[0][0].text == "−"
    assert [one.tag for one in second[0]][:2] == ["mrow", "mo"]
    assert drawn(sum_elements(terms)) == "−σ−1.5×10−5σ·σ"


def test_letters_stand_where_no_value_is_given():
    name = "(tr(sigma)/(1+kappa*abs(tr(sigma))))*sigma"
    assert "κ" in drawn(term_element(name))
    assert "(−0.1)" in drawn(term_element(name, {"kappa": -0.1}))
