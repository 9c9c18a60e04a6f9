"""One equation in any of the forms in which it can leave."""

from collections.abc import Callable, Mapping
from dataclasses import replace

from discover.equations.equation import Equation
from discover.equations.formats.code import numpy_code, sympy_code
from discover.equations.formats.in_a_solver import in_a_solver
from discover.equations.formats.json_format import equation_to_json
from discover.equations.formats.latex_file import equation_latex
from discover.equations.formats.rheotool import rheotool_text
from discover.equations.formats.ufl import ufl_code
from discover.errors import InputError
from discover.plain_json import json_text
from discover.words import unknown_name

FORMATS: Mapping[str, Callable[[Equation], str]] = {
    "python": numpy_code,
    "sympy": sympy_code,
    "latex": equation_latex,
    "json": lambda equation: json_text(equation_to_json(equation)),
    "rheotool": rheotool_text,
    "ufl": ufl_code,
}
"""Functions that write an equation, by the name of the format."""


def write_equation(
    equation: Equation,
    form: str,
    density_kg_m3: float | None = None,
    tolerance: float | None = None,
) -> str:
    """Return an equation as text.

    `equation`: the equation. `form`: key of `FORMATS`. `density_kg_m3`, `tolerance`: for
    ``rheotool`` only; see `discover.equations.formats.rheotool.rheotool_text`. Raises InputError if
    there is no such format, an option does not belong to it, or it has not this law.
    """
    if form not in FORMATS:
        raise InputError(unknown_name("format", form, FORMATS))
    if form != "json":  # which holds what was found, and no more
        said = in_a_solver(equation)
        notes = () if said is None else (said if isinstance(said, str) else said.text,)
        equation = replace(equation, notes=(*equation.notes, *notes))
    options = {"density_kg_m3": density_kg_m3, "tolerance": tolerance}
    given = {name: value for name, value in options.items() if value is not None}
    if form == "rheotool":
        return rheotool_text(equation, **given)
    if given:
        raise InputError(f"Density and tolerance are for --format rheotool; got --format {form}.")
    return FORMATS[form](equation)
