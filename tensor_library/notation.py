"""What a notation says, so that `CandidateTerm.spell` can write terms: LaTeX, Python, SymPy."""

import re
import unicodedata
from collections.abc import Callable, Mapping, Sequence
from typing import Any


class Notation:
    """How one format writes the parts of a term: text by patterns, ``{}`` for what is written."""

    tensors: Mapping[str, Any]
    dot: str  # between tensors
    plus = " + "
    times: str  # between factors
    brackets = "({})"
    whole = "{}"  # around a product
    traced: str
    powered: str  # of a trace and its exponent
    exponential_form: str  # of ``rate`` and ``trace``
    saturating_form: str  # of ``level`` and ``trace``

    def tensor(self, name: str) -> Any:
        """Return the tensor ``I``, ``sigma`` or ``gammadot``."""
        return self.tensors[name]

    def spelled(self, name: str) -> Any:
        """Return a tensor or an invariant by its canonical spelling, as a factor."""
        if name.startswith("tr("):
            return self.trace(self.spelled(name[len("tr(") : -1]))
        each = [one.split(".") for one in name.split("+")]
        summands = [self.contraction([self.tensor(part) for part in parts]) for parts in each]
        return summands[0] if len(summands) == 1 else self.sum(summands)

    def contraction(self, tensors: Sequence[Any]) -> Any:
        """Return the tensors contracted in this order, a·b·c."""
        return self.dot.join(tensors)

    def sum(self, summands: Sequence[Any]) -> Any:
        """Return a sum that may stand as a factor: in text, with its brackets."""
        return self.brackets.format(self.plus.join(summands))

    def trace(self, tensor: Any) -> Any:
        """Return the trace of a contraction."""
        return self.traced.format(tensor)

    def power(self, scalar: Any, exponent: int) -> Any:
        """Return a trace raised to a power of 2 or more."""
        return self.powered.format(scalar, exponent)

    def number(self, value: float) -> Any:
        """Return a number that may stand as a factor: in text, bracketed if it is negative."""
        return self.brackets.format(self.digits_of(value)) if value < 0 else self.digits_of(value)

    def digits_of(self, value: float) -> str:
        """Return a number with the digits that it is given."""
        raise NotImplementedError

    def letter(self, name: str) -> Any:
        """Return the letter of an inner parameter."""
        raise NotImplementedError

    def exponential(self, rate: Any, trace: Any) -> Any:
        """Return exp(rate · trace) − 1, as a factor."""
        return self.exponential_form.format(rate=rate, trace=trace)

    def saturating(self, level: Any, trace: Any) -> Any:
        """Return trace/(1 + level |trace|), as a factor."""
        return self.saturating_form.format(level=level, trace=trace)

    def scalar(self, expression: Any, letters: Mapping[str, Any], factor: bool = False) -> Any:
        """Return a SymPy expression with `letters` for its symbols; bracketed to be a factor."""
        raise NotImplementedError

    def function(self, expression: Callable[[Any, Any], Any], trace: Any, parameter: Any) -> Any:
        """Return a closed form of a user's own, given as a SymPy expression, as a factor."""
        import sympy

        symbols = sympy.symbols("trace parameter", real=True)
        found = sympy.sympify(expression(*symbols))
        return self.scalar(found, {"trace": trace, "parameter": parameter}, factor=True)

    def product(self, factors: Sequence[Any]) -> Any:
        """Return scalars times one tensor, in this order."""
        return self.whole.format(self.times.join(factors))


def printed(
    expression: Any, letters: Mapping[str, str], printer: Callable[[Any], str]
) -> tuple[str, bool]:
    """Return an expression as a printer of SymPy writes it, with given texts for its symbols.

    `expression`: over symbols. `letters`: what stands for them, by their names. `printer`: takes an
    expression and returns text. Returns the text, and whether it needs brackets to be a factor.
    """
    import sympy

    symbols = sorted(expression.free_symbols, key=str)
    # letters alone: printers make accents and indices of what names end in
    stand_ins = [sympy.Symbol(f"scalar{chr(97 + i)}of", real=True) for i in range(len(symbols))]
    text = printer(expression.xreplace(dict(zip(symbols, stand_ins, strict=True))))
    for symbol, stand_in in zip(symbols, stand_ins, strict=True):
        text = text.replace(stand_in.name, letters[symbol.name])
    return text, expression.is_Add or expression.could_extract_minus_sign()


def greek_letter(name: str) -> str | None:
    """Return the Greek letter of this name, a capital one where the name begins so, or None."""
    size = "CAPITAL" if name[:1].isupper() else "SMALL"
    try:
        return unicodedata.lookup(f"GREEK {size} LETTER {name.lower().replace('lambda', 'lamda')}")
    except KeyError:
        return None


def latex_number(value: float, digits: int) -> str:
    """Return a number as LaTeX, powers of ten typeset."""
    mantissa, _, exponent = f"{value:.{digits}g}".partition("e")
    return mantissa + (rf" \times 10^{{{int(exponent)}}}" if exponent else "")


class LatexNotation(Notation):
    """LaTeX with so many significant digits in its numbers."""

    tensors = {  # noqa: RUF012
        "I": r"\boldsymbol{I}",
        "sigma": r"\boldsymbol{\sigma}",
        "gammadot": r"\dot{\boldsymbol{\gamma}}",
    }
    dot, times, brackets = r" \cdot ", r" \, ", r"\left({}\right)"
    traced = r"\operatorname{{tr}}\left({}\right)"
    powered = r"\left({}\right)^{{{}}}"  # tr(σ)² could be taken for tr(σ²)
    exponential_form = r"\left(e^{{{rate} \, {trace}}} - 1\right)"
    saturating_form = r"\frac{{{trace}}}{{1 + {level} \, \left|{trace}\right|}}"

    def __init__(self, digits: int = 5):
        self.digits = digits

    def digits_of(self, value: float) -> str:
        """Return a number, powers of ten typeset."""
        return latex_number(value, self.digits)

    def letter(self, name: str) -> str:
        """Return a Greek letter, or the name in upright letters."""
        if greek_letter(name):
            return rf"\{name}"
        return r"\mathrm{" + name.replace("_", r"\_") + "}"

    def scalar(self, expression: Any, letters: Mapping[str, str], factor: bool = False) -> str:
        """Return the expression as SymPy typesets it."""
        import sympy

        def printer(found: Any) -> str:
            # thin spaces as between the factors of a term; a power is one of the whole letter
            text = sympy.latex(found, mul_symbol=r" \, ")
            return re.sub(r"scalar[a-z]of(?=\^)", lambda one: self.brackets.format(one[0]), text)

        times = r" \times "
        known = {
            n: self.brackets.format(one) if times in one else one for n, one in letters.items()
        }
        text, is_sum = printed(expression, known, printer)
        text = re.sub(r"\\left\((\\[a-zA-Z]+|[^\W\d])\\right\)(?=\^)", r"\1", text)
        return self.brackets.format(text) if factor and is_sum else text
