"""The command that fits one named law to a data folder."""

import json
from pathlib import Path
from typing import Annotated

import typer

from discover.cli.console import say
from discover.cli.guard import guarded
from discover.cli.options import JsonOption, OverwriteOption, QuietOption
from discover.errors import InputError


@guarded
def fit(
    law: Annotated[str, typer.Argument(help="Name of the law; see: discover laws.")],
    data: Annotated[Path, typer.Argument(metavar="folder", help="Data folder.")],
    held_out: Annotated[
        list[str] | None, typer.Option("--held-out", help="Run that only tests the fit.")
    ] = None,
    bounds: Annotated[
        list[str] | None, typer.Option("--bounds", help="Range of a constant: alpha=0:0.5.")
    ] = None,
    start: Annotated[
        list[str] | None, typer.Option("--start", help="Start of a constant: alpha=0.2.")
    ] = None,
    fixed: Annotated[
        list[str] | None, typer.Option("--fix", help="Constant that is not fitted: alpha=0.2.")
    ] = None,
    solvent: Annotated[
        bool, typer.Option("--solvent", help="Also fit a solvent viscosity.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder for page, JSON and equation.")
    ] = None,
    quiet: QuietOption = False,
    as_json: JsonOption = False,
    overwrite: OverwriteOption = False,
) -> None:
    """Fit one named law: constants, intervals, correlation, and how well it describes the runs."""
    from discover.compilation_cache import enable_compilation_cache
    from discover.dataset import load_dataset
    from discover.fitting import fit as fit_law
    from discover.precision import enable_x64

    enable_x64()
    enable_compilation_cache()
    ranges = {name: _bounds(name, text) for name, text in _pairs("bounds", bounds)}
    numbers = [
        {name: _number(option, name, text) for name, text in _pairs(option, given)}
        for option, given in (("start", start), ("fix", fixed))
    ]
    dataset = load_dataset(data)
    found = fit_law(
        law,
        dataset,
        bounds=ranges,
        start=numbers[0],
        fixed=numbers[1],
        effects={"solvent_viscosity": "fit"} if solvent else None,
        held_out=held_out or (),
    )
    if out is not None:
        _write(found, out, overwrite)
    if as_json:
        typer.echo(json.dumps(found.to_json(), indent=2))
    elif not quiet:
        say(found.text)
        if found.constants:
            say(found.summary().to_string(float_format="{:.4g}".format))
        if len(found.constants) > 1:
            say("Correlation:")
            say(found.correlation.to_string(float_format="{:.2f}".format))
        if out is not None:
            say(f"Report: {(out / 'report.html').resolve()}")


def _write(found, out: Path, overwrite: bool) -> None:
    """Write the page and what stands beside it into a folder that holds nothing else."""
    from discover.report.fit import fit_files, fit_page
    from discover.study.run_folder import RunFolder

    folder = RunFolder(out, json.dumps(found.to_json(), sort_keys=True), overwrite)
    for name, text in fit_files(found).items():
        folder.write(name, text)
    folder.write("report.html", fit_page(found))
    folder.finish()


def _pairs(option: str, given: list[str] | None) -> list[tuple[str, str]]:
    for text in given or []:
        if "=" not in text:
            raise InputError(f"--{option} takes NAME=VALUE; got {text!r}.")
    return [(name.strip(), value) for name, _, value in (t.partition("=") for t in given or [])]


def _number(option: str, name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise InputError(f"--{option} {name} must be a number; got {text!r}.") from None


def _bounds(name: str, text: str) -> tuple[float, float]:
    low, colon, high = text.partition(":")
    if not colon:
        raise InputError(f"--bounds {name} must be two numbers, low:high; got {text!r}.")
    return _number("bounds", name, low), _number("bounds", name, high)
