"""Isotropic tensor functions written out, for laws that are no sums of terms."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from tensor_library.algebra import INVARIANT_NAMES, TENSOR_NAMES
from tensor_library.notation import Notation

if TYPE_CHECKING:
    import sympy

RESERVED = ("s", "d", "unit", "constant", "mode", "variables", "np", "sympy", "ufl")
"""Names that the exported text has for its own."""


def scalars(*names: str) -> Any:
    """Return the SymPy symbols of invariants, constants, defined scalars; one alone as itself."""
    import sympy

    found = tuple(sympy.Symbol(name, real=True) for name in names)
    return found[0] if len(found) == 1 else found


@dataclass(frozen=True)
class IsotropicFunction:
    """h = Σ gₙ Tₙ(σ, γ̇), with each gₙ an expression in invariants and constants.

    `coefficients`: gₙ by tensor of `TENSOR_NAMES`, over `scalars`. `where`: scalars defined on the
    way, in order. `letters`: LaTeX of constants whose names are no letters. `rates`: of each
    structure variable, over 1/λ. Raises ValueError if a tensor or name is unusable.

    Examples
    --------
    >>> IsotropicFunction({"sigma": scalars("epsilon") * scalars("tr(sigma)")}).constants
    ('epsilon',)
    """

    coefficients: Mapping[str, "sympy.Expr"]
    where: Mapping[str, "sympy.Expr"] = field(default_factory=dict)
    letters: Mapping[str, str] = field(default_factory=dict)
    rates: Mapping[str, "sympy.Expr"] = field(default_factory=dict)

    def __post_init__(self):
        unknown = [name for name in self.coefficients if name not in TENSOR_NAMES]
        if unknown:
            raise ValueError(f"{unknown[0]!r} is not one of {', '.join(TENSOR_NAMES)}.")
        names = [*self.where, *self.constants, *self.rates]
        wrong = [name for name in names if name in RESERVED or not name.isidentifier()]
        if wrong:
            raise ValueError(
                f"{wrong[0]!r} cannot name a constant; write a word other than "
                f"{', '.join(RESERVED)}."
            )

    @property
    def constants(self) -> tuple[str, ...]:
        """Names of the constants, in alphabetical order."""
        expressions = [*self.coefficients.values(), *self.where.values(), *self.rates.values()]
        names = {str(symbol) for one in expressions for symbol in one.free_symbols}
        return tuple(sorted(names - {*INVARIANT_NAMES, *self.where, *self.rates}))

    def spell(
        self, notation: Notation, letters: Mapping[str, Any]
    ) -> tuple[list[tuple[str, Any]], list[tuple[str, Any]], list[Any]]:
        """Return `where` and `rates` by name, and the summands of h, with `letters` for scalars."""
        known = {**letters, **{name: notation.spelled(name) for name in INVARIANT_NAMES}}
        where, rates = (
            [(name, notation.scalar(one, known)) for name, one in each.items()]
            for each in (self.where, self.rates)
        )
        summands = []
        for name, coefficient in self.coefficients.items():
            one = notation.scalar(coefficient, known, factor=True)
            summands.append(notation.product([one, notation.spelled(name)]))
        return where, rates, summands
