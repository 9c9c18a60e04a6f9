"""SymPy's notation, apart: to import SymPy takes as long as a twentieth of a second demo."""

from collections.abc import Mapping, Sequence
from typing import Any

import sympy

from tensor_library.notation import Notation

STRESS = sympy.Symbol("sigma", commutative=False)
RATE = sympy.Symbol("gammadot", commutative=False)
UNIT = sympy.Symbol("I", commutative=False)


class Trace(sympy.Function):
    """Trace of a product of tensors: a scalar, so it commutes."""

    is_commutative = True
    nargs = 1

    # SymPy has a Trace of its own, of matrices, and prints any class of that name as if it were it
    def _latex(self, printer, exp=None):
        text = rf"\operatorname{{tr}}\left({printer._print(self.args[0])}\right)"
        return text if exp is None else rf"{text}^{{{exp}}}"

    def _pretty(self, printer):
        return printer._print_Function(self, func_name="tr")


class SympyNotation(Notation):
    """Expressions; brackets are the expression tree's own."""

    def tensor(self, name: str) -> sympy.Expr:
        return {"I": UNIT, "sigma": STRESS, "gammadot": RATE}[name]

    def contraction(self, tensors: Sequence[sympy.Expr]) -> sympy.Expr:
        return sympy.Mul(*tensors)

    def sum(self, summands: Sequence[sympy.Expr]) -> sympy.Expr:
        return sympy.Add(*summands)

    def trace(self, tensor: sympy.Expr) -> sympy.Expr:
        return Trace(tensor)  # pyright: ignore[reportReturnType]

    def power(self, scalar: sympy.Expr, exponent: int) -> sympy.Expr:
        return sympy.Pow(scalar, exponent)

    def number(self, value: float) -> sympy.Expr:
        return sympy.Float(value)

    def letter(self, name: str) -> sympy.Expr:
        return sympy.Symbol(name)

    def exponential(self, rate: sympy.Expr, trace: sympy.Expr) -> sympy.Expr:
        return sympy.exp(rate * trace) - 1  # pyright: ignore[reportReturnType]

    def saturating(self, level: sympy.Expr, trace: sympy.Expr) -> sympy.Expr:
        return trace / (1 + level * sympy.Abs(trace))

    def scalar(
        self, expression: Any, letters: Mapping[str, sympy.Expr], factor: bool = False
    ) -> sympy.Expr:
        return expression.xreplace({one: letters[one.name] for one in expression.free_symbols})

    def product(self, factors: Sequence[sympy.Expr]) -> sympy.Expr:
        return sympy.Mul(*factors)
