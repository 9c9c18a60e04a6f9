"""Learned laws as a LaTeX file."""

from discover.comparison.comparison import Comparison
from discover.equations.latex import PREAMBLE, law_latex
from discover.learners.registry import learner_title


def equations_tex(comparison: Comparison, linear_relaxation: bool) -> str:
    """Return ``equations.tex``: the law that each learner found."""
    parts = [PREAMBLE]
    for name, outcome in comparison.outcomes.items():
        equation = law_latex(outcome.terms, linear_relaxation)
        parts.append(
            f"% {learner_title(name)}\n\\begin{{equation}}\n  {equation}\n\\end{{equation}}\n"
        )
    return "\n".join(parts)
