"""Laws as SymPy expressions: over tensors, and component by component."""

from collections.abc import Sequence

import sympy

from discover.equations.term import TermLike
from tensor_library.symbolic import SympyNotation
from tensor_library.terms import parse_term


def extra_term_expression(terms: Sequence[TermLike]) -> sympy.Expr:
    """Return h as an expression over the non-commuting tensors of `tensor_library.symbolic`."""
    total: sympy.Expr = sympy.Integer(0)
    notation = SympyNotation()
    for term in terms:
        total = total + parse_term(term.term).spell(notation, term.coefficient, term.inner)
    return total
