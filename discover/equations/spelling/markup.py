"""Laws as LaTeX, MathML and SymPy expressions."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from discover.equations.parts import NamedPart
from tensor_library import LawTerm, parse_term
from tensor_library.notation import (
    LatexNotation,
    Notation,
    greek_letter,
    latex_number,
    printed,
)

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
    # all on the left, so that each term has the sign that tables and files give it
    text = r"\overset{\nabla}{\boldsymbol{\sigma}}"
    if linear_relaxation:
        text += r" + \boldsymbol{\sigma}"
    notation = LatexNotation(digits)
    defined: list[tuple[str, str]] = []
    if named is not None:
        spelled = latex_letters(named, notation)
        summands, defined = _named(named, notation, spelled, r"\dot{{{}}}")
        text += "".join(f" + {summand}" for summand in summands)
    letters: dict[str, float] = {}
    for term in terms:
        # a letter has one value in an equation; where it has another, that number stands itself
        other = {
            n: value for n, value in term.inner.items() if letters.setdefault(n, value) != value
        }
        sign = "+" if term.coefficient >= 0 else "-"
        text += f" {sign} {parse_term(term.term).spell(notation, _factor(term), other)}"
    text += r" = \dot{\boldsymbol{\gamma}}"
    defined += [(notation.letter(n), latex_number(v, digits)) for n, v in letters.items()]
    return text + "".join(f"{SEPARATOR}{letter} = {value}" for letter, value in defined)


def _named(
    named: NamedPart, notation: Notation, letters: Mapping[str, str], rate: str
) -> tuple[Sequence[str], list[tuple[str, str]]]:
    """Return the summands of a named law, and what its rates, scalars and constants are."""
    function, fixed = named.function, named.constants[0]
    defined, summands = function.spell(notation, letters)
    rates = function.spell_rates(notation, letters)
    return summands, [
        *((rate.format(letters[name]), value) for name, value in rates),
        *((letters[name], value) for name, value in defined),
        *((letters[n], notation.digits_of(v))
          for n, v in fixed.items() if n not in named.differing),
    ]  # fmt: skip


def _factor(term: LawTerm) -> float | None:
    """Return the size of a coefficient; None for one, which nobody writes."""
    size = abs(term.coefficient)
    return None if size == 1.0 else size


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


_BOLD = '<mi mathvariant="normal" style="font-weight:bold">{}</mi>'
# the combining dot sits well in every font, an accent over a letter only in mathematical ones
_TENSORS = {"I": _BOLD.format("I"), "sigma": _BOLD.format("σ"), "gammadot": _BOLD.format("γ̇")}
_APPLIED = "<mo>&#x2061;</mo>"
_TRACE = f'<mi mathvariant="normal">tr</mi>{_APPLIED}'
_SPACE = "<mspace width='0.15em'/>"
_BRACKETS = "<mrow><mo>(</mo>{}<mo>)</mo></mrow>"


def number(value: float) -> str:
    """Return a number as MathML, four digits, powers of ten where it is very small or large."""
    text = f"{value:.4g}"
    minus = "<mo>−</mo>" if text.startswith("-") else ""
    mantissa, _, exponent = text.lstrip("-").partition("e")
    body = f"{minus}<mn>{mantissa}</mn>"
    if exponent:
        body += f"<mo>×</mo><msup><mn>10</mn><mn>{int(exponent)}</mn></msup>"
    return body


class MathmlNotation(Notation):
    """Presentation MathML, without `math` element."""

    tensors = _TENSORS
    dot, plus, times, brackets = "<mo>·</mo>", "<mo>+</mo>", _SPACE, _BRACKETS
    whole = "<mrow>{}</mrow>"
    traced = _TRACE + _BRACKETS
    powered = f"<msup>{_BRACKETS}<mn>{{}}</mn></msup>"  # tr(σ)² could be taken for tr(σ²)
    exponential_form = _BRACKETS.format(
        f'<mi mathvariant="normal">exp</mi>{_APPLIED}'
        f"{_BRACKETS.format(f'{{rate}}{_SPACE}{{trace}}')}<mo>−</mo><mn>1</mn>"
    )
    saturating_form = (
        f"<mfrac><mrow>{{trace}}</mrow><mrow><mn>1</mn><mo>+</mo>{{level}}{_SPACE}"
        "<mrow><mo>|</mo>{trace}<mo>|</mo></mrow></mrow></mfrac>"
    )

    def digits_of(self, value: float) -> str:
        """Return a number."""
        return number(value)

    def letter(self, name: str) -> str:
        """Return a Greek letter, or the name itself."""
        return f"<mi>{greek_letter(name) or name}</mi>"

    def scalar(self, expression: Any, letters: Mapping[str, str], factor: bool = False) -> str:
        """Return the expression as SymPy typesets it."""
        import sympy

        def printer(found: Any) -> str:
            return sympy.mathml(found, printer="presentation")

        known = {
            name: _BRACKETS.format(text) if text.startswith(_TRACE) else text
            for name, text in letters.items()
        }
        text, is_sum = printed(expression, known, printer, "<mi>{}</mi>")
        return _BRACKETS.format(text) if factor and is_sum else f"<mrow>{text}</mrow>"


def term_mathml(
    name: str, inner: Mapping[str, float] | None, coefficient: float | None = None
) -> str:
    """Return a term by its canonical spelling, without `math` element.

    `inner`: by name; one that is missing stays a letter. `coefficient`: number in front.
    """
    return parse_term(name).spell(MathmlNotation(), coefficient, inner)


def term_element(name: str, inner: Mapping[str, float] | None = None) -> str:
    """Return a term as a `math` element."""
    return f"<math>{term_mathml(name, inner)}</math>"


class InUnitsNotation(MathmlNotation):
    """MathML in units, for each mode: τ for σ/G, and λ before γ̇, with index k of several modes."""

    def __init__(self, modes: int):
        index = "<msub>{}<mi>k</mi></msub>" if modes > 1 else "{}"
        self.stress = index.format(_BOLD.format("τ"))
        self.time, self.modulus = index.format("<mi>λ</mi>"), index.format("<mi>G</mi>")

    def tensor(self, name: str) -> str:
        """Return a bold letter."""
        if name == "sigma":
            return self.stress
        return f"{self.time}{_TENSORS[name]}" if name == "gammadot" else _TENSORS[name]


# Of a summand that begins an element of its own, where it would be spaced as a prefix
_SIGN = "<mo form='infix'>{}</mo>"


def law_element(
    terms: Sequence[LawTerm], linear_relaxation: bool, named: NamedPart | None = None,
    modes: int = 0, solvent: bool = False, rest: bool = False,
) -> str:  # fmt: skip
    """Return the whole law, displayed; each summand is a `math` element, so that lines break.

    `modes`: how many a law in Pa and s has; 0 for a dimensionless one. `solvent`: whether that has
    one. `rest`: whether it has a summand h that stands elsewhere.
    """
    notation = InUnitsNotation(modes) if modes else MathmlNotation()
    stress, rate = notation.tensor("sigma"), notation.tensor("gammadot")
    convected = f"<mover><mrow>{stress}</mrow><mo style='font-size:70%'>▽</mo></mover>"
    relaxation = f"<mo>+</mo>{stress}" if linear_relaxation else ""
    extra = [
        _SIGN.format("+" if t.coefficient >= 0 else "−")
        + parse_term(t.term).spell(notation, _factor(t), t.inner)
        for t in terms
    ]
    extra += [_SIGN.format("+") + "<mi>h</mi>"] if rest else []
    where = []
    if named is not None:
        function = named.function
        names = (*function.constants, *function.where, *function.rates)
        letters = {n: notation.letter(n) for n in names}
        letters |= {n: f"<msub>{letters[n]}<mi>k</mi></msub>" for n in named.differing}
        dotted = "<mover><mrow>{}</mrow><mo>˙</mo></mover>"
        summands, defined = _named(named, notation, letters, dotted)
        extra = [_SIGN.format("+") + one for one in summands] + extra
        where = [
            f"<mo>,</mo><mspace width='1em'/>{left}<mo>=</mo>{value}" for left, value in defined
        ]
    # all on the left, so that each term has the sign that tables and files give it
    time = notation.time if isinstance(notation, InUnitsNotation) else ""
    parts = [f"{time}{convected}{relaxation}", *extra]
    parts[-1] += f"<mo form='infix'>=</mo>{rate}"
    parts += where
    if isinstance(notation, InUnitsNotation):
        parts.append(_whole_stress(notation, modes, solvent))
    law = "<wbr/>".join(f"<math displaystyle='true'><mrow>{part}</mrow></math>" for part in parts)
    return f'<div class="law" style="text-align:center;margin:.6em 0">{law}</div>'


def _whole_stress(notation: InUnitsNotation, modes: int, solvent: bool) -> str:
    """Return how the stress follows from the modes."""
    total = "<munder><mo>∑</mo><mi>k</mi></munder>" if modes > 1 else ""
    added = f"<mo>+</mo><msub><mi>η</mi><mi>s</mi></msub>{_TENSORS['gammadot']}" if solvent else ""
    stress = f"{_TENSORS['sigma']}<mo>=</mo>{total}{notation.modulus}{notation.stress}{added}"
    return f"<mspace width='2em'/>{stress}"


def extra_term_expression(terms: Sequence[LawTerm], named: NamedPart | None) -> "sympy.Expr":
    """Return h over the non-commuting tensors of `tensor_library.sympy_notation`.

    Constants that differ from mode to mode, and structure variables, stay letters.
    """
    import sympy

    from tensor_library.sympy_notation import SympyNotation

    total: Any = sympy.Integer(0)
    notation = SympyNotation()
    if named is not None:
        letters = {name: sympy.Float(value) for name, value in named.constants[0].items()}
        letters |= {name: sympy.Symbol(name) for name in named.differing}
        function = named.function
        letters |= {name: sympy.Symbol(name) for name in (*function.where, *function.rates)}
        where, summands = function.spell(notation, letters)
        total = sympy.Add(*summands)
        for name, value in reversed(where):
            total = total.subs(letters[name], value)
    for term in terms:
        total = total + parse_term(term.term).spell(notation, term.coefficient, term.inner)
    return total
