r"""Terms as LaTeX: bold tensors, centred dots for contractions, ``\operatorname{tr}``."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from tensor_library.notation import Notation, greek_letter, printed

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
