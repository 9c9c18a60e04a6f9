r"""Terms as LaTeX: bold tensors, centred dots for contractions, ``\operatorname{tr}``."""

from collections.abc import Callable, Sequence
from typing import Any

from tensor_library.notation import Notation, greek_letter, printed

_TENSORS = {
    "I": r"\boldsymbol{I}",
    "sigma": r"\boldsymbol{\sigma}",
    "gammadot": r"\dot{\boldsymbol{\gamma}}",
}


def latex_number(value: float, digits: int = 5) -> str:
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
        return rf"\{name}" if greek_letter(name) else rf"\mathrm{{{name}}}"

    def exponential(self, rate: str, trace: str) -> str:
        """Return the bracketed exponential minus one."""
        return _bracketed(rf"e^{{{rate} \, {trace}}} - 1")

    def saturating(self, level: str, trace: str) -> str:
        """Return a fraction."""
        return rf"\frac{{{trace}}}{{1 + {level} \, \left|{trace}\right|}}"

    def function(self, expression: Callable[[Any, Any], Any], trace: str, parameter: str) -> str:
        """Return the expression as SymPy typesets it, bracketed where it is a sum."""
        import sympy

        number = _bracketed(parameter) if " " in parameter else parameter
        text, brackets = printed(expression, _bracketed(trace), number, sympy.latex)
        return _bracketed(text) if brackets else text

    def product(self, factors: Sequence[str]) -> str:
        """Return the factors with thin spaces between them."""
        return r" \, ".join(factors)


def _bracketed(text: str) -> str:
    return rf"\left({text}\right)"
