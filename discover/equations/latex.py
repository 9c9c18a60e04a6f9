"""Laws as LaTeX."""

from collections.abc import Sequence

from discover.equations.term import TermLike
from tensor_library.latex import LatexNotation, latex_number
from tensor_library.terms import parse_term

PREAMBLE = """% Written by discover. Dimensionless: stress over modulus, time over relaxation time.
% The triangle marks the upper convected derivative. Needs amsmath and bm or boldsymbol.
"""
"""First lines of a file with laws."""


def law_latex(terms: Sequence[TermLike], linear_relaxation: bool, digits: int = 5) -> str:
    """Return a dimensionless law as one LaTeX equation.

    Parameters
    ----------
    terms
        h as a sum.
    linear_relaxation
        Whether the −σ is there beside h.
    digits
        Significant digits of the numbers.
    """
    text = r"\overset{\nabla}{\boldsymbol{\sigma}} = \dot{\boldsymbol{\gamma}}"
    if linear_relaxation:
        text += r" - \boldsymbol{\sigma}"
    notation = LatexNotation(digits)
    letters: dict[str, float] = {}
    for term in terms:
        # a letter has one value in an equation; where it has another, that number stands itself
        other = {
            n: value for n, value in term.inner.items() if letters.setdefault(n, value) != value
        }
        sign = "-" if term.coefficient >= 0 else "+"
        text += f" {sign} {parse_term(term.term).spell(notation, abs(term.coefficient), other)}"
    for name, value in letters.items():
        text += rf", \qquad {notation.letter(name)} = {latex_number(value, digits)}"
    return text
