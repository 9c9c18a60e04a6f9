"""Terms as SymPy expressions and as LaTeX."""

from typing import TYPE_CHECKING

import sympy
from sympy.printing.latex import LatexPrinter

if TYPE_CHECKING:
    from tensor_library.terms import CandidateTerm

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


_TENSORS = (
    UNIT,
    STRESS,
    RATE,
    STRESS**2,
    RATE**2,
    STRESS * RATE + RATE * STRESS,
    STRESS**2 * RATE + RATE * STRESS**2,
    STRESS * RATE**2 + RATE**2 * STRESS,
)
_INVARIANTS: tuple[sympy.Expr, ...] = (  # pyright: ignore[reportAssignmentType]
    Trace(STRESS),
    Trace(STRESS**2),
    Trace(RATE**2),
    Trace(STRESS**3),
    Trace(RATE**3),
    Trace(STRESS**2 * RATE),
    Trace(STRESS * RATE**2),
    Trace(STRESS * RATE),
)


def _closed_form(name: str) -> sympy.Expr:
    trace = Trace(STRESS)
    if name == "exp":
        return sympy.exp(sympy.Symbol("epsilon") * trace) - 1
    if name == "saturating":
        return trace / (1 + sympy.Symbol("kappa") * sympy.Abs(trace))
    raise ValueError(f"The closed form {name!r} has no symbolic form.")


def term_expression(term: "CandidateTerm") -> sympy.Expr:
    """Return a candidate term as a SymPy expression."""
    scalar = sympy.Integer(1)
    if term.closed_form is not None:
        scalar *= _closed_form(term.closed_form)
    for invariant, power in zip(_INVARIANTS, term.powers, strict=True):
        scalar *= sympy.Pow(invariant, power)
    return scalar * _TENSORS[term.tensor]


class RheologyLatexPrinter(LatexPrinter):
    """LaTeX with bold tensors and single contractions as centred dots."""

    def _print_Symbol(self, expr, style="plain"):
        del style
        special = {
            STRESS: r"\boldsymbol{\sigma}",
            RATE: r"\dot{\boldsymbol{\gamma}}",
            UNIT: r"\boldsymbol{I}",
        }
        return special.get(expr) or super()._print_Symbol(expr)

    def _print_Pow(self, expr):
        if expr.base in (STRESS, RATE) and expr.exp.is_Integer:
            return r" \cdot ".join([self._print(expr.base)] * int(expr.exp))
        return super()._print_Pow(expr)

    def _print_Mul(self, expr):
        scalars, tensors = expr.args_cnc()
        if not tensors:
            return super()._print_Mul(expr)
        text = r" \cdot ".join(
            rf"\left({self._print(t)}\right)" if t.is_Add else self._print(t) for t in tensors
        )
        scalar = sympy.Mul(*scalars)
        if scalar == 1:
            return text
        if scalar == -1:
            return "- " + text
        printed = self._print(scalar)
        if scalar.is_Add:
            printed = rf"\left({printed}\right)"
        return rf"{printed} \, {text}"


def to_latex(expression: sympy.Expr) -> str:
    """Return an expression over tensors as LaTeX."""
    return RheologyLatexPrinter().doprint(expression)
