"""Laws as LaTeX."""

from collections.abc import Sequence

from discover.equations.equation import Equation, TermLike
from tensor_library.latex import LatexNotation, latex_number
from tensor_library.spelling import spell
from tensor_library.terms import parse_term

PREAMBLE = """% Written by discover. Dimensionless: stress over modulus, time over relaxation time.
% The triangle marks the upper convected derivative. Needs amsmath and bm or boldsymbol.
"""
"""First lines of a file with laws."""


def law_latex(terms: Sequence[TermLike], linear_relaxation: bool, digits: int = 5) -> str:
    """Return a dimensionless law as one LaTeX equation.

    Parameters
    ----------
    terms
        h as a sum.
    linear_relaxation
        Whether the −σ is there beside h.
    digits
        Significant digits of the numbers.
    """
    text = r"\overset{\nabla}{\boldsymbol{\sigma}} = \dot{\boldsymbol{\gamma}}"
    if linear_relaxation:
        text += r" - \boldsymbol{\sigma}"
    notation = LatexNotation(digits)
    letters: dict[str, float] = {}
    for term in terms:
        # a letter has one value in an equation; where it has another, that number stands itself
        other = {
            n: value for n, value in term.inner.items() if letters.setdefault(n, value) != value
        }
        sign = "-" if term.coefficient >= 0 else "+"
        text += f" {sign} {spell(parse_term(term.term), notation, abs(term.coefficient), other)}"
    for name, value in letters.items():
        text += rf", \qquad \{name} = {latex_number(value, digits)}"
    return text


def equation_latex(equation: Equation, digits: int = 9) -> str:
    """Return an equation with its modes, solvent and tested box as a piece of a LaTeX document."""
    lines = [PREAMBLE + "".join(f"% {line}\n" for line in header_lines(equation))]
    law = law_latex(equation.terms, equation.linear_relaxation, digits)
    lines.append(f"\\begin{{equation}}\n  {law}\n\\end{{equation}}\n")
    lines.append("% modes: modulus in Pa, relaxation time in s\n\\begin{align}")
    for k, (g, time) in enumerate(zip(equation.modulus, equation.relaxation_time, strict=True), 1):
        lines.append(
            f"  G_{{{k}}} &= {latex_number(g, digits)}\\,\\mathrm{{Pa}}, & "
            f"\\lambda_{{{k}}} &= {latex_number(time, digits)}\\,\\mathrm{{s}} \\\\"
        )
    lines.append(
        f"  \\eta_\\mathrm{{s}} &= {latex_number(equation.solvent_viscosity, digits)}"
        "\\,\\mathrm{Pa\\,s}\n\\end{align}\n"
    )
    return "\n".join(lines)


def header_lines(equation: Equation) -> list[str]:
    """Return origin, notes and tested box as plain lines that no file format takes amiss."""
    lines = [equation.title, *equation.notes]
    lines += [] if equation.tested is None else equation.tested.lines
    return [plain_line(line) for line in lines if line]


def plain_line(text: str) -> str:
    """Return one line of text without anything that could end a comment or a string."""
    text = " ".join(text.split())
    return "".join(c if c.isprintable() and c not in "\"\\'`" else "_" for c in text).replace(
        "*/", "* /"
    )[:300]
