"""Laws as LaTeX, MathML and SymPy expressions; LaTeX in plain signs."""

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any
from xml.etree.ElementTree import tostring

from discover.equations.parts import NamedPart
from tensor_library import LawTerm, parse_term
from tensor_library.notation import LatexNotation, Notation, greek_letter

if TYPE_CHECKING:
    import sympy

PREAMBLE = """% Written by discover. Dimensionless: stress over modulus, time over relaxation time.
% The triangle marks the upper-convected derivative. Needs amsmath and bm or boldsymbol.
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

    `linear_relaxation`: whether the −σ is there. `named`: a law to whose h the terms are added.
    """
    sums, defined = _law(terms, linear_relaxation, LatexNotation(digits), named)
    return SEPARATOR.join([" ".join(sums), *defined])


def _law(
    terms: Sequence[LawTerm], linear_relaxation: bool, notation: LatexNotation,
    named: NamedPart | None, time: str = "", rest: bool = False,
) -> tuple[list[str], list[str]]:  # fmt: skip
    """Law in pieces between which a line may break, and what its letters are.

    `time`: before the derivative. `rest`: whether a summand h stands elsewhere.
    """
    stress = notation.tensor("sigma")
    # all on the left, so that each term has the sign that tables and files give it
    pieces = [rf"{time}\overset{{\nabla}}{{{stress}}}" + f" + {stress}" * linear_relaxation]
    defined: list[tuple[str, str]] = []
    if named is not None:
        function, fixed = named.function, named.constants[0]
        spelled = latex_letters(named, notation)
        where, rates, summands = function.spell(notation, spelled)
        pieces += [f"+ {summand}" for summand in summands]
        defined += [(rf"\dot{{{spelled[name]}}}", value) for name, value in rates]
        defined += [(spelled[name], value) for name, value in where]
        constant = {n: value for n, value in fixed.items() if n not in named.differing}
        defined += [(spelled[n], notation.digits_of(value)) for n, value in constant.items()]
    letters: dict[str, float] = {}
    for term in terms:
        # a letter has one value in an equation; where it has another, that number stands itself
        other = {
            n: value for n, value in term.inner.items() if letters.setdefault(n, value) != value
        }
        pieces.append(_summand(term, notation, other))
    pieces += ["+ h"] * rest
    pieces[-1] += f" = {notation.tensor('gammadot')}"
    defined += [(notation.letter(n), notation.digits_of(v)) for n, v in letters.items()]
    return pieces, [f"{letter} = {value}" for letter, value in defined]


def _summand(term: LawTerm, notation: Notation, inner: Mapping[str, float]) -> str:
    """Return a term with its sign; nobody writes a coefficient of one."""
    size = abs(term.coefficient)
    spelled = parse_term(term.term).spell(notation, None if size == 1.0 else size, inner)
    return f"{'+' if term.coefficient >= 0 else '-'} {spelled}"


def latex_letters(named: NamedPart, notation: LatexNotation) -> dict[str, str]:
    """Return the LaTeX of a named law's constants and defined scalars, with index k by mode."""
    function = named.function

    def letter(name: str) -> str:
        if name in function.letters:
            return function.letters[name]
        return name if len(name) == 1 else notation.letter(name)

    names = (*function.constants, *function.where, *function.rates)
    found = {name: letter(name) for name in names}
    return found | {name: f"{found[name]}_{{k}}" for name in named.differing}


class DisplayedNotation(LatexNotation):
    """LaTeX of what pages show, four digits; with `modes` in Pa and s: τ for σ/G, λ before γ̇."""

    # the combining dot sits well in every font, an accent over a letter only in mathematical ones
    tensors = {**LatexNotation.tensors, "gammadot": r"\textbf{γ̇}"}  # noqa: RUF012

    def __init__(self, modes: int = 0):
        super().__init__(digits=4)
        index = "_{k}" if modes > 1 else ""
        self.time, self.modulus = (rf"\lambda{index} ", f"G{index} ") if modes else ("", "")
        if modes:
            rate = self.time + self.tensors["gammadot"]
            own = {"sigma": rf"\boldsymbol{{\tau}}{index}", "gammadot": rate}
            self.tensors = {**self.tensors, **own}

    def letter(self, name: str) -> str:
        """Return a Greek letter in the shape that the page has it in its text."""
        return greek_letter(name) or super().letter(name)


_MINUS = "&#x02212;"  # as the converter writes signs
_OPENING = ("&#x00028;", "&#x0002C;", "&#x0003D;")  # ( , =


def math_element(latex: str, displayed: bool = False) -> str:
    """Return LaTeX as a `math` element, with the LaTeX for those who cannot see it."""
    from latex2mathml.converter import convert_to_element

    # a sign between summands that begins an element would be spaced as a prefix
    math = convert_to_element(f"{{}} {latex}" if latex.startswith(("+ ", "- ")) else latex)
    math.attrib = {"alttext": latex} | ({"displaystyle": "true"} if displayed else {})
    before = ""
    for part in math.iter():
        if part.get("mathvariant", "").startswith("bold"):  # which browsers do not take
            part.attrib = {"mathvariant": "normal", "style": "font-weight:bold"}
        if part.tag == "mo" and (part.text or "").isalpha():  # spaced as a sign
            part.tag = "mi"
        if part.text == _MINUS and before in _OPENING:
            part.set("form", "prefix")
        before = part.text or before
    return tostring(math, encoding="unicode").replace("&amp;#", "&#")


def term_element(name: str, inner: Mapping[str, float] | None = None) -> str:
    """Return a term by its canonical spelling; of `inner`, one that is missing stays a letter."""
    return math_element(parse_term(name).spell(DisplayedNotation(), None, inner))


def sum_elements(terms: Sequence[LawTerm]) -> str:
    """Return a sum of terms, each a `math` element, so that lines break."""
    summands = [_summand(term, DisplayedNotation(), term.inner) for term in terms]
    first = re.sub(r"^\+ |(?<=^-) ", "", summands[0])
    return " ".join(map(math_element, [first, *summands[1:]]))


def law_element(
    terms: Sequence[LawTerm], linear_relaxation: bool, named: NamedPart | None = None,
    modes: int = 0, solvent: bool = False, rest: bool = False,
) -> str:  # fmt: skip
    """Return the whole law, displayed; each summand is a `math` element, so that lines break.

    `modes`: how many a law in Pa and s has; 0 for a dimensionless one. `solvent`: whether that has
    one. `rest`: whether it has a summand h that stands elsewhere.
    """
    notation = DisplayedNotation(modes)
    pieces, defined = _law(terms, linear_relaxation, notation, named, notation.time, rest)
    for one in defined:
        pieces[-1] += ","
        pieces.append(rf"\quad {one}")
    if modes:
        stress, rate = (DisplayedNotation.tensors[name] for name in ("sigma", "gammadot"))
        total = r"\underset{k}{\sum} " if modes > 1 else ""
        added = rf" + \eta_{{s}} {rate}" if solvent else ""
        pieces.append(
            rf"\qquad {stress} = {total}{notation.modulus}{notation.tensor('sigma')}{added}"
        )
    law = "<wbr/>".join(math_element(piece, displayed=True) for piece in pieces)
    return f'<div class="law" style="text-align:center;margin:.6em 0">{law}</div>'


def extra_term_expression(terms: Sequence[LawTerm], named: NamedPart | None) -> "sympy.Expr":
    """Return h over non-commuting tensors; constants by mode, and variables, stay letters."""
    import sympy

    from tensor_library.sympy_notation import SympyNotation

    total: Any = sympy.Integer(0)
    notation = SympyNotation()
    if named is not None:
        letters = {name: sympy.Float(value) for name, value in named.constants[0].items()}
        letters |= {name: sympy.Symbol(name) for name in named.differing}
        function = named.function
        letters |= {name: sympy.Symbol(name) for name in (*function.where, *function.rates)}
        where, _, summands = function.spell(notation, letters)
        total = sympy.Add(*summands)
        for name, value in reversed(where):
            total = total.subs(letters[name], value)
    for term in terms:
        total = total + parse_term(term.term).spell(notation, term.coefficient, term.inner)
    return total


_SIGNS = dict(
    cdot=" · ", times=" × ", to=" → ", sum="Σ ", int="∫ ", partial="∂", infty="∞", nabla="∇",
    le=" ≤ ", leq=" ≤ ", ge=" ≥ ", geq=" ≥ ", approx=" ≈ ", pm=" ± ", quad=" ", left="", right="",
)  # fmt: skip
_FONTS = {"mathrm", "mathbf", "mathrel", "text", "operatorname", "boldsymbol", "bm"}
_ACCENTS = {"dot": "\u0307", "ddot": "\u0308", "hat": "\u0302", "bar": "\u0304", "tilde": "\u0303"}


def plain(latex: str) -> str:
    """Return a formula in plain signs, to be read aloud or where it cannot be set."""
    tokens = re.findall(r"\\[A-Za-z]+|\\.|\s+|.", latex.strip().strip("$"), flags=re.S)
    tokens.reverse()
    return re.sub(r"\s+", " ", _until_brace(tokens)).strip()


def _until_brace(tokens: list[str]) -> str:
    text = ""
    while tokens and tokens[-1] != "}":
        text += _next(tokens)
    if tokens:
        tokens.pop()
    return text


def _next(tokens: list[str]) -> str:
    """Return the next sign or group of tokens that are taken from the end of a list."""
    token = tokens.pop()
    name = token[1:]
    if token == "{":
        return _until_brace(tokens)
    if token in "^_":
        argument = _argument(tokens)
        return token + (argument if argument.isalnum() or len(argument) == 1 else f"({argument})")
    if not token.startswith("\\"):
        return token
    if name in _FONTS:
        return _argument(tokens)
    if name in _ACCENTS:
        return _argument(tokens) + _ACCENTS[name]
    if name in ("frac", "tfrac", "dfrac"):
        over, under = _argument(tokens), _argument(tokens)
        return "/".join(part if part.isalnum() else f"({part})" for part in (over, under))
    if name == "overset":
        over, under = _argument(tokens), _argument(tokens)
        return f"{under}^{over}"
    letter = greek_letter(name.removeprefix("var"))
    return letter or _SIGNS.get(name, name if name.isalpha() else " ")


def _argument(tokens: list[str]) -> str:
    while tokens and tokens[-1].isspace():
        tokens.pop()
    return _next(tokens) if tokens else ""
