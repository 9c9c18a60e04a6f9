"""Laws as SymPy expressions: over tensors, and component by component."""

from collections.abc import Sequence

import sympy

from discover.equations.parts import NamedPart
from tensor_library import LawTerm, parse_term
from tensor_library.notation import SympyNotation


def extra_term_expression(terms: Sequence[LawTerm], named: NamedPart | None) -> sympy.Expr:
    """Return h over the non-commuting tensors of `tensor_library.notation`.

    Constants that differ from mode to mode, and structure variables, stay letters.
    """
    total: sympy.Expr = sympy.Integer(0)
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
