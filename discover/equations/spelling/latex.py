"""Laws as LaTeX."""

from collections.abc import Sequence

from discover.equations.named_part import NamedPart
from tensor_library.latex import LatexNotation, latex_number
from tensor_library.law_terms import LawTerm
from tensor_library.terms import parse_term

PREAMBLE = """% Written by discover. Dimensionless: stress over modulus, time over relaxation time.
% The triangle marks the upper convected derivative. Needs amsmath and bm or boldsymbol.
"""
"""First lines of a file with laws."""

SEPARATOR = r", \qquad "
"""Stands before each scalar that a law defines beside itself."""


def law_latex(
    terms: Sequence[LawTerm],
    linear_relaxation: bool,
    digits: int = 5,
    named: NamedPart | None = None,
) -> str:
    """Return a dimensionless law as one LaTeX equation.

    `terms`: h as a sum. `linear_relaxation`: whether the −σ is there beside h. `digits`:
    significant digits of the numbers. `named`: A law with a name to whose h the terms are added.
    """
    # all on the left, so that each term has the sign that tables and files give it
    text = r"\overset{\nabla}{\boldsymbol{\sigma}}"
    if linear_relaxation:
        text += r" + \boldsymbol{\sigma}"
    notation = LatexNotation(digits)
    defined: list[tuple[str, str]] = []
    if named is not None:
        spelled = latex_letters(named, notation)
        defined, summands = named.function.spell(notation, spelled)
        text += "".join(f" + {summand}" for summand in summands)
        defined = [(spelled[name], value) for name, value in defined]
        rates = named.function.spell_rates(notation, spelled)
        defined = [(rf"\dot{{{spelled[name]}}}", value) for name, value in rates] + defined
        constants = named.constants[0].items()
        fixed = [(spelled[n], v) for n, v in constants if n not in named.differing]
        defined += [(letter, latex_number(value, digits)) for letter, value in fixed]
    letters: dict[str, float] = {}
    for term in terms:
        # a letter has one value in an equation; where it has another, that number stands itself
        other = {
            n: value for n, value in term.inner.items() if letters.setdefault(n, value) != value
        }
        sign = "+" if term.coefficient >= 0 else "-"
        text += f" {sign} {parse_term(term.term).spell(notation, abs(term.coefficient), other)}"
    text += r" = \dot{\boldsymbol{\gamma}}"
    defined += [(notation.letter(n), latex_number(v, digits)) for n, v in letters.items()]
    return text + "".join(f"{SEPARATOR}{letter} = {value}" for letter, value in defined)


def latex_letters(named: NamedPart, notation: LatexNotation) -> dict[str, str]:
    """Return how LaTeX writes the constants and the defined scalars of a law with a name.

    What differs from mode to mode has the index k.
    """
    function = named.function

    def letter(name: str) -> str:
        if name in function.letters:
            return function.letters[name]
        return name if len(name) == 1 else notation.letter(name)

    names = (*function.constants, *function.where, *function.rates)
    found = {name: letter(name) for name in names}
    return found | {name: f"{found[name]}_{{k}}" for name in named.differing}
