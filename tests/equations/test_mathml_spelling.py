"""What MathML says to its reader: what is drawn is evaluated, not how it is nested.

An `mrow` groups nothing that can be seen, so the reader below takes its content as if it stood
outside; only brackets, bars, fractions and superscripts hold things together.
"""

import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from spelled_laws import BOTH_SIGNS, LIBRARY_LAWS, STATES, agree, sum_of

from discover.equations.spelling.markup import _TENSORS, law_element, term_element, term_mathml

_SIGNS = {"−": "-", "·": "@", "×": "*", "+": "+", "(": "(", ")": ")", "\u2061": ""}


def words(element):
    """Return what an element draws, in a row, in the words of Python."""
    rows = [words(child) for child in element]
    if element.tag in ("math", "mrow"):
        return [word for row in rows for word in row]
    if element.tag == "mfrac":
        above, below = rows
        return ["((", *above, ")/(", *below, "))"]
    if element.tag == "msup":
        base, exponent = rows
        # a superscript belongs to what stands right before it: one thing, or one bracket
        assert len(base) == 1 or (base[0], base[-1]) == ("(", ")")
        return [*base, "**", *exponent]
    if element.tag == "mspace":
        return []
    if element.tag == "mo" and element.text != "|":
        return [_SIGNS[element.text]]
    return [element.text]


def said(row):
    """Return a row as an expression; what stands side by side is multiplied."""
    text, bars = "", 0
    for word in row:
        if word == "|":
            bars += 1
            word = "abs(" if bars % 2 else ")"
        begins = word[:1] == "(" or word[:1].isalnum()
        ends = text[-1:] == ")" or text[-1:].isalnum() or text.endswith("\u0307")
        applied = text.endswith(("tr", "exp"))
        text += "*" * (begins and ends and not applied) + word
    return text


def read(mathml, **letters):
    """Return the value at every state."""
    text = said(words(ElementTree.fromstring(mathml)))
    known = {"tr": np.trace, "exp": np.exp, **letters}
    states = ({"σ": stress, "γ̇": rate, "I": np.eye(3)} for stress, rate in STATES)
    return np.array([eval(text, known | state) for state in states])


def relaxation(law):
    """Return what stands between the derivative and the sign of equality, in one element again."""
    one = re.sub("</mrow></math><wbr/><math[^>]*><mrow>", "", law).removesuffix("</div>")
    left, _, right = one.partition("<mo form='infix'>=</mo>")
    derivative, _, left = left.partition("</mover><mo>+</mo>")
    assert "▽" in derivative
    assert right.startswith(_TENSORS["gammadot"])
    return f"<math><mrow>{left}</mrow></math>"


def extra_by_mathml(law):
    """Return h at every state from the displayed law, the convected derivative + σ + h = γ̇."""
    return read(relaxation(law)) - np.array([stress for stress, _ in STATES])


@pytest.mark.parametrize("name", BOTH_SIGNS)
def test_the_mathml_of_every_term_law_and_effect_says_it(name):
    spelled = BOTH_SIGNS[name]
    # four digits are shown: those of the laws of the library have three
    exact = name[:-2] in LIBRARY_LAWS
    assert agree(
        extra_by_mathml(law_element(spelled.equation.terms, True)),
        spelled.extra,
        1e-10 if exact else 5e-4,
    )


def test_a_long_law_can_break_between_its_summands():
    terms = sum_of([5, 6], [0.2, 0.1]).equation.terms
    # browsers break a line between elements, never within one
    assert law_element(terms, True).count("</math><wbr/><math") == len(terms)


def test_letters_stand_where_no_value_is_given():
    name = "(tr(sigma)/(1+kappa*abs(tr(sigma))))*sigma"
    traces = [np.trace(s) for s, _ in STATES]
    wanted = [t / (1 + 0.4 * abs(t)) * s for t, (s, _) in zip(traces, STATES, strict=True)]
    assert agree(read(term_element(name), κ=0.4), np.array(wanted))
    wanted = [t / (1 - 0.1 * abs(t)) * s for t, (s, _) in zip(traces, STATES, strict=True)]
    assert agree(read(term_element(name, {"kappa": -0.1})), np.array(wanted))


def test_a_number_in_front_of_a_term_multiplies_all_of_it():
    spelled = sum_of([5], [-1.5e-5])
    found = read(f"<math>{term_mathml(spelled.equation.terms[0].term, None, -1.5e-5)}</math>")
    assert agree(found, spelled.extra)


def test_a_sum_without_its_brackets_is_another_law():
    """Negative control: the reader does see a missing bracket."""
    spelled = sum_of([5], [0.2])
    text = law_element(spelled.equation.terms, True)
    bare = text.replace("<mo>(</mo>", "").replace("<mo>)</mo>", "")
    assert not agree(extra_by_mathml(bare), spelled.extra, 0.1)
