"""Learned laws as a LaTeX file."""

from discover.comparison.comparison import Comparison
from discover.equations.latex import PREAMBLE, law_latex
from discover.learners.registry import learner_title


def equations_tex(comparison: Comparison, linear_relaxation: bool) -> str:
    """Return ``equations.tex``: the law that each learner found, with the known part below it."""
    parts = [PREAMBLE]
    for name, outcome in comparison.outcomes.items():
        known = comparison.known_part_of(name)
        terms = (*known.terms, *outcome.terms)
        named, beside = known.named, ""
        if named is not None and not named.is_written:
            named, beside = None, f", without the h of the known law {named.law}"
        equation = law_latex(terms, linear_relaxation, named=named)
        head = f"% {learner_title(name)}{beside}\n"
        parts.append(f"{head}\\begin{{equation}}\n  {equation}\n\\end{{equation}}\n")
    return "\n".join(parts)
