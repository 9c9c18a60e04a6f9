"""What a notation has to say, so that terms can be written in it: LaTeX, MathML, Python, SymPy.

`CandidateTerm.spell` decides once what a term is made of, in which order, and where a sum needs
brackets. A notation only says how it writes a tensor, a product or a bracket.
"""

import re
import unicodedata
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Generic, TypeVar

T = TypeVar("T")


class Notation(ABC, Generic[T]):
    """How one format writes the parts of a term."""

    @abstractmethod
    def tensor(self, name: str) -> T:
        """Return the tensor ``I``, ``sigma`` or ``gammadot``."""

    @abstractmethod
    def contraction(self, tensors: Sequence[T]) -> T:
        """Return the tensors contracted in this order, a·b·c."""

    @abstractmethod
    def sum(self, summands: Sequence[T]) -> T:
        """Return a sum that may stand as a factor: in text, with its brackets."""

    @abstractmethod
    def trace(self, tensor: T) -> T:
        """Return the trace of a contraction."""

    @abstractmethod
    def power(self, scalar: T, exponent: int) -> T:
        """Return a trace raised to a power of 2 or more."""

    @abstractmethod
    def number(self, value: float) -> T:
        """Return a number that may stand as a factor: in text, bracketed if it is negative."""

    @abstractmethod
    def letter(self, name: str) -> T:
        """Return the letter of an inner parameter."""

    @abstractmethod
    def exponential(self, rate: T, trace: T) -> T:
        """Return exp(rate · trace) − 1, as a factor."""

    @abstractmethod
    def saturating(self, level: T, trace: T) -> T:
        """Return trace/(1 + level |trace|), as a factor."""

    @abstractmethod
    def scalar(self, expression: Any, letters: Mapping[str, T], factor: bool = False) -> T:
        """Return a SymPy expression with `letters` for its symbols; bracketed to be a factor."""

    def function(self, expression: Callable[[Any, Any], Any], trace: T, parameter: T) -> T:
        """Return a closed form of a user's own, given as a SymPy expression, as a factor."""
        import sympy

        symbols = sympy.symbols("trace parameter", real=True)
        found = sympy.sympify(expression(*symbols))
        return self.scalar(found, {"trace": trace, "parameter": parameter}, factor=True)

    @abstractmethod
    def product(self, factors: Sequence[T]) -> T:
        """Return scalars times one tensor, in this order."""


def printed(
    expression: Any,
    letters: Mapping[str, str],
    printer: Callable[[Any], str],
    placeholder: str = "{}",
) -> tuple[str, bool]:
    """Return an expression as a printer of SymPy writes it, with given texts for its symbols.

    `expression`: over symbols. `letters`: what stands for them, by their names. `printer`: takes an
    expression and returns text. `placeholder`: how the printer writes a symbol, with ``{}`` for its
    name. Returns the text, and whether it needs brackets to be a factor.
    """
    import sympy

    symbols = sorted(expression.free_symbols, key=str)
    # letters alone: printers make accents and indices of what names end in
    stand_ins = [sympy.Symbol(f"scalar{chr(97 + i)}of", real=True) for i in range(len(symbols))]
    text = printer(expression.xreplace(dict(zip(symbols, stand_ins, strict=True))))
    for symbol, stand_in in zip(symbols, stand_ins, strict=True):
        text = text.replace(placeholder.format(stand_in.name), letters[symbol.name])
    return text, expression.is_Add or expression.could_extract_minus_sign()


def greek_letter(name: str) -> str | None:
    """Return the Greek letter of this name, a capital one where the name begins so, or None."""
    size = "CAPITAL" if name[:1].isupper() else "SMALL"
    try:
        return unicodedata.lookup(f"GREEK {size} LETTER {name.lower().replace('lambda', 'lamda')}")
    except KeyError:
        return None


_TENSORS = {
    "I": r"\boldsymbol{I}",
    "sigma": r"\boldsymbol{\sigma}",
    "gammadot": r"\dot{\boldsymbol{\gamma}}",
}


def latex_number(value: float, digits: int) -> str:
    """Return a number as LaTeX, powers of ten typeset."""
    mantissa, _, exponent = f"{value:.{digits}g}".partition("e")
    return mantissa + (rf" \times 10^{{{int(exponent)}}}" if exponent else "")


class LatexNotation(Notation[str]):
    """LaTeX with so many significant digits in its numbers."""

    def __init__(self, digits: int = 5):
        self.digits = digits

    def tensor(self, name: str) -> str:
        """Return a bold letter."""
        return _TENSORS[name]

    def contraction(self, tensors: Sequence[str]) -> str:
        r"""Return the tensors with ``\cdot`` between them."""
        return r" \cdot ".join(tensors)

    def sum(self, summands: Sequence[str]) -> str:
        """Return the bracketed sum."""
        return _bracketed(" + ".join(summands))

    def trace(self, tensor: str) -> str:
        r"""Return ``\operatorname{tr}`` of the bracketed contraction."""
        return r"\operatorname{tr}" + _bracketed(tensor)

    def power(self, scalar: str, exponent: int) -> str:
        """Return the bracketed trace and its exponent: tr(σ)² could be taken for tr(σ²)."""
        return f"{_bracketed(scalar)}^{{{exponent}}}"

    def number(self, value: float) -> str:
        """Return a number, bracketed if negative."""
        text = latex_number(value, self.digits)
        return _bracketed(text) if text.startswith("-") else text

    def letter(self, name: str) -> str:
        """Return a Greek letter, or the name in upright letters."""
        if greek_letter(name):
            return rf"\{name}"
        return r"\mathrm{" + name.replace("_", r"\_") + "}"

    def exponential(self, rate: str, trace: str) -> str:
        """Return the bracketed exponential minus one."""
        return _bracketed(rf"e^{{{rate} \, {trace}}} - 1")

    def saturating(self, level: str, trace: str) -> str:
        """Return a fraction."""
        return rf"\frac{{{trace}}}{{1 + {level} \, \left|{trace}\right|}}"

    def scalar(self, expression: Any, letters: Mapping[str, str], factor: bool = False) -> str:
        """Return the expression as SymPy typesets it."""
        import sympy

        def printer(found: Any) -> str:
            # thin spaces as between the factors of a term; a power is one of the whole letter
            text = sympy.latex(found, mul_symbol=r" \, ")
            return re.sub(r"scalar[a-z]of(?=\^)", lambda one: _bracketed(one[0]), text)

        times = r" \times "
        known = {n: _bracketed(one) if times in one else one for n, one in letters.items()}
        text, is_sum = printed(expression, known, printer)
        return _bracketed(text) if factor and is_sum else text

    def product(self, factors: Sequence[str]) -> str:
        """Return the factors with thin spaces between them."""
        return r" \, ".join(factors)


def _bracketed(text: str) -> str:
    return rf"\left({text}\right)"
