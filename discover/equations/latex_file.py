"""An equation as a piece of a LaTeX document, and the plain lines that every file begins with."""

from discover.equations.equation import Equation
from discover.equations.latex import PREAMBLE, law_latex
from tensor_library.latex import latex_number


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
