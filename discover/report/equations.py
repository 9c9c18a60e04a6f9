"""Learned laws as a LaTeX file."""

from discover.comparison.comparison import Comparison
from discover.learners.result import RecoveredTerm
from discover.report.plots.style import LEARNER_TITLES

_HEADER = r"""% Written by discover. Dimensionless: stress over modulus, time over relaxation time.
% The triangle marks the upper convected derivative. Needs amsmath and bm or boldsymbol.
"""


def latex_number(value: float, digits: int = 5) -> str:
    """Return the size of a number as LaTeX, powers of ten typeset."""
    mantissa, _, exponent = f"{abs(value):.{digits}g}".partition("e")
    return mantissa + (rf" \times 10^{{{int(exponent)}}}" if exponent else "")


def law_latex(terms: tuple[RecoveredTerm, ...], linear_relaxation: bool) -> str:
    """Return a learned law as one LaTeX equation."""
    text = r"\overset{\nabla}{\boldsymbol{\sigma}} = \dot{\boldsymbol{\gamma}}"
    if linear_relaxation:
        text += r" - \boldsymbol{\sigma}"
    for term in terms:
        sign = "-" if term.coefficient >= 0 else "+"
        text += rf" {sign} {latex_number(term.coefficient)} \, {term.latex}"
    inner = {name: value for term in terms for name, value in term.inner.items()}
    for name, value in inner.items():
        text += rf", \qquad \{name} = {latex_number(value)}"
    return text


def equations_tex(comparison: Comparison, linear_relaxation: bool) -> str:
    """Return ``equations.tex``: the law that each learner found."""
    parts = [_HEADER]
    for name, outcome in comparison.outcomes.items():
        equation = law_latex(outcome.terms, linear_relaxation)
        parts.append(
            f"% {LEARNER_TITLES[name]}\n\\begin{{equation}}\n  {equation}\n\\end{{equation}}\n"
        )
    return "\n".join(parts)
