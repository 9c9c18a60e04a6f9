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

_FUNCTIONS = {"tr": np.trace, "exp": np.exp}
_SUMS = ("+", "−")


def drawn(element):
    """Return what an element draws, in a row."""
    if element.tag in ("math", "mrow"):
        return [one for child in element for one in drawn(child)]
    return [] if element.tag == "mspace" else [element]


class Reader:
    """Evaluates a row by the precedence of the page: sums, then products, then superscripts."""

    def __init__(self, row, letters):
        self.row, self.letters, self.at = row, letters, 0
        self.closing = [None]

    def symbol(self):
        if self.at == len(self.row):
            return None
        element = self.row[self.at]
        return element.text if element.tag == "mo" else ""

    def sum(self):
        sign = 1.0
        if self.symbol() in _SUMS:
            sign = -1.0 if self.symbol() == "−" else 1.0
            self.at += 1
        total = sign * self.product()
        while self.symbol() in _SUMS:
            sign = -1.0 if self.symbol() == "−" else 1.0
            self.at += 1
            summand = self.product()
            assert np.shape(total) == np.shape(summand), "scalar plus tensor"
            total = total + sign * summand
        return total

    def product(self):
        product = self.factor()
        while self.symbol() not in (*_SUMS, self.closing[-1]):
            if self.symbol() in ("·", "×"):
                self.at += 1
            factor = self.factor()
            both = np.ndim(product) and np.ndim(factor)
            product = product @ factor if both else product * factor
        return product

    def factor(self):
        element = self.row[self.at]
        self.at += 1
        if element.tag == "mn":
            return float(element.text)
        if element.tag == "mfrac":
            above, below = (Reader(drawn(one), self.letters).all() for one in element)
            return above / below
        if element.tag == "msup":
            base, exponent = (Reader(drawn(one), self.letters).all() for one in element)
            # a superscript belongs to what stands right before it: one thing, or one bracket
            row = drawn(element[0])
            assert len(row) == 1 or (row[0].text == "(" and row[-1].text == ")")
            assert np.ndim(base) == 0
            return base**exponent
        if element.tag == "mi" and element.text in _FUNCTIONS:
            assert self.symbol() == "\u2061"
            self.at += 1
            assert self.symbol() == "(", f"{element.text} of what?"
            return _FUNCTIONS[element.text](self.factor())
        if element.tag == "mi":
            return self.letters[element.text]
        assert element.text in ("(", "|"), f"cannot read {element.text!r}"
        self.closing.append({"(": ")", "|": "|"}[element.text])
        inside = self.sum()
        assert self.symbol() == self.closing.pop()
        self.at += 1
        return inside if element.text == "(" else abs(inside)

    def all(self):
        value = self.sum()
        assert self.at == len(self.row)
        return value


def read(mathml, **letters):
    """Return the value at every state."""
    element = ElementTree.fromstring(mathml)
    found = []
    for stress, rate in STATES:
        known = {"σ": stress, "γ̇": rate, "I": np.eye(3), **letters}
        found.append(Reader(drawn(element), known).all())
    return np.array(found)


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
