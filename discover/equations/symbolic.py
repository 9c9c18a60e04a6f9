"""Laws as SymPy expressions: over tensors, and component by component."""

from collections.abc import Sequence

import sympy

from discover.equations.equation import TermLike
from tensor_library.terms import parse_term


def extra_term_expression(terms: Sequence[TermLike]) -> sympy.Expr:
    """Return h as an expression over the non-commuting tensors of `tensor_library.symbolic`."""
    total: sympy.Expr = sympy.Integer(0)
    for term in terms:
        expression = parse_term(term.term).sympy()
        values = [(sympy.Symbol(name), sympy.Float(value)) for name, value in term.inner.items()]
        total = total + sympy.Float(term.coefficient) * expression.subs(values)
    return total
