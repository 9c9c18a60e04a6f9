"""Results that are a law, as SymPy and LaTeX."""

from typing import TYPE_CHECKING

from discover.equations.equation import Equation

if TYPE_CHECKING:
    import sympy


class HasEquation:
    """A result with an `equation`, and what follows from it."""

    def equation(self) -> Equation:
        """Return the law as an equation."""
        raise NotImplementedError

    def sympy(self) -> "sympy.Expr":
        """Return the extra term h as a SymPy expression over non-commuting tensors.

        Raises
        ------
        InputError
            If the law is no sum of library terms.
        """
        return self.equation().sympy()

    def latex(self) -> str:
        """Return the dimensionless law as one LaTeX equation.

        Raises
        ------
        InputError
            If the law is no sum of library terms.
        """
        return self.equation().latex()
