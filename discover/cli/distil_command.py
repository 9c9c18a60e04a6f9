"""The command that teaches one law to another."""

import json
from typing import Annotated

import typer

from discover.cli.console import progress_bar
from discover.cli.guard import guarded
from discover.cli.options import JsonOption, QuietOption
from discover.errors import InputError

PAPER_PAIRS = (
    ("giesekus:alpha=0.2", "ucm"),
    ("ptt_exponential:epsilon=0.2", "ucm"),
    ("giesekus:alpha=0.2", "ptt_linear"),
    ("giesekus:alpha=0.2", "fene_p"),
    ("ptt_linear:epsilon=0.2", "giesekus"),
    ("ptt_linear:epsilon=0.2", "fene_p"),
    ("fene_p:L2=20", "giesekus"),
    ("fene_p:L2=20", "ptt_linear"),
)
"""The two pairs of the paper and those it proposes."""


@guarded
def distil(
    teacher: Annotated[
        str | None,
        typer.Option(
            "--teacher", help="Law to imitate, with parameters, such as giesekus:alpha=0.2."
        ),
    ] = None,
    student: Annotated[
        str | None,
        typer.Option("--student", help="Law to fit, such as ucm, or any other with a constant."),
    ] = None,
    penalty: Annotated[float, typer.Option("--penalty", help="Weight of the paper's penalty.")] = (
        0.01
    ),
    quiet: QuietOption = False,
    as_json: JsonOption = False,
) -> None:
    """Fit one law to the shear stress of another; without options, for the paper's pairs."""
    if (teacher is None) != (student is None):
        raise InputError("Give --teacher and --student together, or neither for the paper's pairs.")
    from discover.compilation_cache import enable_compilation_cache
    from discover.precision import enable_x64

    enable_x64()
    enable_compilation_cache()
    from discover.laws.registry import make_law
    from discover.learners.distillation import distil as teach

    pairs = PAPER_PAIRS if teacher is None or student is None else ((teacher, student),)
    rows = []
    with progress_bar(quiet) as report:
        for i, (source, pupil) in enumerate(pairs):
            report(f"{source} teaches {pupil}", i / len(pairs))
            law = make_law(*_parse_law(source))
            rows.append({"teacher": source, **teach(law, pupil, penalty=penalty).as_dict()})
    if as_json:
        typer.echo(json.dumps(rows, indent=2))
        return
    typer.echo(
        f"{'teacher':<30}{'student':<18}{'with penalty':<28}{'without':<28}{'σ12 misfit':>10}"
    )
    for row in rows:
        typer.echo(
            f"{row['teacher']:<30}{row['student']:<18}{_values(row['penalised']):<28}"
            f"{_values(row['debiased']):<28}{100 * row['misfit']:>8.2f} %"
        )
    if teacher is None:
        return
    typer.echo("\nWhat is lost, as a share of each (of N2, as a share of N1):")
    for flow, errors in rows[0]["errors"].items():
        shown = "one of the two diverges" if errors is None else _values(errors, percent=True)
        typer.echo(f"{flow:<14}{shown}")


def _parse_law(text: str) -> tuple[str, dict[str, float]]:
    from discover.dataset.importing.text_rows import is_number

    name, _, rest = text.partition(":")
    parameters = {}
    for part in filter(None, rest.split(",")):
        key, equals, value = part.partition("=")
        # float() also reads 1_2, nan and digits of other scripts
        if not equals or not is_number(value.strip()):
            raise InputError(
                f"Cannot read {part!r} in {text!r}; write parameters as name=number, such as "
                "giesekus:alpha=0.2."
            )
        parameters[key.strip()] = float(value)
    return name.strip(), parameters


def _values(parameters: dict[str, float], percent: bool = False) -> str:
    if percent:
        return ", ".join(f"{key} {100 * value:.3g} %" for key, value in parameters.items())
    return ", ".join(f"{key}={value:.4f}" for key, value in parameters.items())
