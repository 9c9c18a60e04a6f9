"""An equation as a piece of a LaTeX document, and the plain lines that every file begins with."""

from discover.effects.registry import Spelled
from discover.equations.equation import Equation
from discover.equations.parts import StatePart
from discover.equations.spelling.markup import PREAMBLE, SEPARATOR, latex_letters, law_latex
from tensor_library.notation import LatexNotation, latex_number


def equation_latex(equation: Equation, digits: int = 9) -> str:
    """Return an equation with its modes, solvent and tested box as a piece of a LaTeX document."""
    lines = [PREAMBLE + "".join(f"% {line}\n" for line in header_lines(equation))]
    named = equation.named
    law = law_latex(equation.terms, equation.linear_relaxation, digits, named)
    # what a law with a name defines on the way would not fit into one line
    law, *where = [law] if named is None else law.split(SEPARATOR)
    lines.append(f"\\begin{{equation}}\n  {law}\n\\end{{equation}}\n")
    if where:
        rows = " \\\\\n".join("  " + one.replace(" = ", " &= ", 1) for one in where)
        lines.append(f"\\begin{{align}}\n{rows}\n\\end{{align}}\n")
    for part, spelled in zip(equation.states, equation.spelled_states, strict=True):
        lines.append(_state(part, spelled, digits))
    letters = {} if named is None else latex_letters(named, LatexNotation(digits))
    if named is not None:
        lines += [f"% {letters[n]}: {n} of the law {named.law}" for n in named.constants[0]]
    lines.append("% modes: modulus in Pa, relaxation time in s\n\\begin{align}")
    for k, (g, time) in enumerate(zip(equation.modulus, equation.relaxation_time, strict=True)):
        own = [("G_{k}", g, r"\,\mathrm{Pa}"), (r"\lambda_{k}", time, r"\,\mathrm{s}")]
        own += [(letters[n], named.of_mode(k)[n], "") for n in named.differing] if named else []
        entries = (
            f"{letter.replace('_{k}', f'_{{{k + 1}}}')} &= {latex_number(value, digits)}{unit}"
            for letter, value, unit in own
        )
        lines.append(f"  {', & '.join(entries)} \\\\")
    lines.append(
        f"  \\eta_\\mathrm{{s}} &= {latex_number(equation.solvent_viscosity, digits)}"
        "\\,\\mathrm{Pa\\,s}\n\\end{align}\n"
    )
    return "\n".join(lines)


def _state(part: StatePart, spelled: Spelled, digits: int) -> str:
    """Return the equation of a state of the whole fluid, with its numbers."""
    numbers = ",\\quad ".join(
        f"{spelled.symbols[p.name]} = {latex_number(part.values[p.name], digits)}"
        + (rf"\,\mathrm{{{p.unit}}}" if p.unit else "")
        for p in part.own.parameters
    )
    lines = [f"% {part.effect}, of the whole fluid", "\\begin{gather}"]
    return "\n".join([*lines, f"  {spelled.equation} \\\\", f"  {numbers}", "\\end{gather}\n"])


def header_lines(equation: Equation) -> list[str]:
    """Return origin, notes and tested box as plain lines that no file format takes amiss."""
    lines = [equation.title, *equation.notes]
    lines += [] if equation.tested is None else equation.tested.lines
    whole = (" ".join(line.split()) for line in lines if line)
    # without anything that could end a comment or a string
    return [
        "".join(c if c.isprintable() and c not in "\"\\'`" else "_" for c in line).replace(
            "*/", "* /"
        )[:300]
        for line in whole
    ]
