"""What a learner hands on: the same kind of result from both."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from jaxtyping import Float, Num

from discover.equations import Equation, EquationTerm, combined, law_terms
from discover.laws.base import AbstractConstitutiveLaw

if TYPE_CHECKING:
    import sympy


@dataclass(frozen=True)
class RecoveredTerm:
    """One term of a recovered law.

    Attributes
    ----------
    term
        Canonical spelling.
    coefficient
        Refitted without penalty (debiased).
    coefficient_penalised
        From the penalised or thresholded problem that selected it, or None where there was none.
    ci95
        95 % interval of `coefficient`, or None where not computed.
    inner
        Inner parameters by name.
    latex
        The term as LaTeX, without its coefficient.
    inner_ci95
        95 % intervals of the inner parameters.
    inner_at_one
        For a closed form whose coefficient may be one, as in the law that it is named after:
        each inner parameter with its 95 % interval (value, low, high) if the coefficient is one.
    """

    term: str
    coefficient: float
    coefficient_penalised: float | None = None
    ci95: tuple[float, float] | None = None
    inner: Mapping[str, float] = field(default_factory=dict)
    latex: str = ""
    inner_ci95: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    inner_at_one: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class LearnerResult:
    """A learned law and how it was learned.

    Attributes
    ----------
    learner
        Name of the learner.
    law
        The law, dimensionless, ready to simulate.
    terms
        The law, or its projection on a library, term by term.
    train_seconds
        Wall-clock time of `fit`.
    loss_history
        Iterations and losses, both of shape (m,).
    details
        What else this learner can say; JSON-able.
    message
        One sentence on how the fit ended.
    """

    learner: str
    law: AbstractConstitutiveLaw
    terms: tuple[RecoveredTerm, ...]
    train_seconds: float
    loss_history: tuple[Num[np.ndarray, " m"], Float[np.ndarray, " m"]]
    details: Mapping[str, Any] = field(default_factory=dict)
    message: str = ""

    def equation(self) -> Equation:
        """Return the law term by term, a known law below it included, dimensionless.

        Of a network this is its projection on the library.
        """
        base = getattr(self.law, "base", None)
        found = tuple(
            EquationTerm(t.term, t.coefficient, dict(t.inner), t.ci95) for t in self.terms
        )
        known = () if base is None else law_terms(base)
        return Equation(
            combined(known + found) if known else found,
            linear_relaxation=self.law.linear_relaxation,
        )

    def sympy(self) -> "sympy.Expr":
        """Return the extra term h as a SymPy expression over non-commuting tensors."""
        return self.equation().sympy()

    def latex(self) -> str:
        """Return the dimensionless law as one LaTeX equation."""
        return self.equation().latex()

    def table(self) -> pd.DataFrame:
        """Return the terms with their coefficients and 95 % intervals, one line each."""
        columns = ["term", "coefficient", "low", "high", "penalised", "inner"]
        lines = []
        for t in self.terms:
            low, high = (None, None) if t.ci95 is None else t.ci95
            inner = ", ".join(f"{name} = {value:.6g}" for name, value in t.inner.items())
            lines.append((t.term, t.coefficient, low, high, t.coefficient_penalised, inner))
        return pd.DataFrame(lines, columns=columns)

    def _repr_html_(self) -> str:
        import html

        table = self.table().dropna(axis="columns", how="all")
        return (
            f"<p><b>{html.escape(self.learner)}</b>: {html.escape(self.message)}</p>"
            f"{self.equation()._repr_html_()}"
            f"{table.to_html(index=False, escape=True, float_format='{:.4g}'.format)}"
        )
