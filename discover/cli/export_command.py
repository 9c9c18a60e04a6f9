"""The command that writes a law out in a form that other programs take."""

import math
from pathlib import Path
from typing import Annotated

import typer

from discover.cli.console import say
from discover.cli.guard import guarded


@guarded
def export(
    results: Annotated[
        Path,
        typer.Argument(
            help="Result folder of a finished compare or close-loop.", show_default=False
        ),
    ],
    form: Annotated[
        str, typer.Option("--format", "-f", help="python, sympy, latex, json, rheotool or ufl.")
    ] = "python",
    law: Annotated[
        str | None,
        typer.Option("--law", help="Learner whose law to write; default: the sparse one."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="File to write; default: standard output.")
    ] = None,
    density: Annotated[
        float | None,
        typer.Option("--density", min=0.0, help="Density in kg/m3, for rheotool; default: 1000."),
    ] = None,
    tolerance: Annotated[
        float | None,
        typer.Option(
            "--tolerance",
            min=0.0,
            max=0.5,
            help="For rheotool: accepted deviation from a law it knows; default: 0.01.",
        ),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the file.")] = False,
) -> None:
    """Write the law found as Python, SymPy, LaTeX, JSON, UFL or a rheoTool dictionary."""
    from discover.equations.files import choose_law, read_result_laws, write_equation
    from discover.errors import InputError
    from discover.precision import enable_x64
    from discover.study.atomic import make_folder, replaceable, write_text

    if density is not None and not 0.0 < density < math.inf:
        raise InputError(f"--density must be a positive number of kg/m3; got {density}. Try 1000.")
    if tolerance is not None and math.isnan(tolerance):
        raise InputError("--tolerance must be a number from 0 to 0.5; got nan. Try 0.01.")
    enable_x64()
    equation = choose_law(read_result_laws(results), law)
    text = write_equation(equation, form, density, tolerance)
    if out is None:
        # half a character in a title, which no terminal can show
        typer.echo(text.encode("utf-8", "backslashreplace").decode("utf-8"), nl=False)
        return
    if replaceable(out) is not None and not overwrite:
        raise InputError(f"{out} exists. Use --overwrite to replace it, or another --out.")
    make_folder(out.parent)
    write_text(out, text)
    say(f"{out} written.")
