"""Laws as SymPy expressions: over tensors, and component by component."""

from collections.abc import Sequence

import sympy

from discover.equations.equation import TermLike
from tensor_library.spelling import spell
from tensor_library.symbolic import SympyNotation
from tensor_library.terms import parse_term


def extra_term_expression(terms: Sequence[TermLike]) -> sympy.Expr:
    """Return h as an expression over the non-commuting tensors of `tensor_library.symbolic`."""
    total: sympy.Expr = sympy.Integer(0)
    notation = SympyNotation()
    for term in terms:
        total = total + spell(parse_term(term.term), notation, term.coefficient, term.inner)
    return total
