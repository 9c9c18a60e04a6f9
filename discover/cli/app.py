"""The commands, but for those on data. Nothing heavy is imported before one runs."""

import gc
import json
import math
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument, Option

from discover._version import __version__
from discover.cli import console
from discover.cli.console import Number, Place, Text, Texts, progress_bar
from discover.cli.data_commands import data_app
from discover.errors import InputError
from discover.processor import use_one_thread_from_the_start, use_the_processor_from_the_start
from discover.report.plots import keep_out_of_the_working_directory

if TYPE_CHECKING:  # --help needs no tables
    import pandas as pd

app = typer.Typer(
    name="discover",
    help="Find the constitutive equation of a viscoelastic fluid from rheometer data, and say "
    "what the data can and cannot tell. To begin: discover demo",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


@app.command("demo")
@console.guarded
def demo(
    out: Annotated[Path, Option("--out", "-o", help="Folder for the results.")] = Path(
        "discover-demo"
    ),
    seed: console.SeedOption = None,
    quiet: console.QuietOption = False,
    overwrite: console.OverwriteOption = False,
) -> None:
    """Run a small comparison and a closed loop on synthetic data, in about a minute."""
    from discover.batch.run import run_demo

    with progress_bar(quiet) as report:
        pages = run_demo(out, seed, overwrite, report)
    if not quiet:
        for title, page in pages.items():
            console.say(f"{title}: {page.resolve()}")
        typer.echo("Open them in a browser.")


def _command(task: str, words: str) -> Callable[..., None]:
    """Return the command that runs one task of `discover.batch.run` on a study."""

    def command(
        study: console.StudyArgument,
        out: console.OutOption = None,
        seed: console.SeedOption = None,
        quiet: console.QuietOption = False,
        as_json: console.JsonOption = False,
        overwrite: console.OverwriteOption = False,
        tolerance: console.ToleranceOption = None,
    ) -> None:
        from discover.batch import run

        folder = out or Path("results") / run.folder_names([study])[0]
        with progress_bar(quiet) as report:
            execute = getattr(run, task)
            result = execute(study, folder, seed, overwrite, report, tolerance)
        if as_json:
            typer.echo(result.json_file.read_text("utf-8"))
        elif not quiet:
            if result.was_complete:
                console.say(f"{folder} is complete; use --overwrite to start afresh.")
            console.say(result.text)
            console.say(f"Report: {result.report.resolve()}")

    command.__doc__ = words
    return console.guarded(command)


app.command("compare")(
    _command(
        "run_compare",
        "Fit the data with sparse regression and a neural network; compare both laws.",
    )
)
app.command("close-loop")(
    _command(
        "run_close_loop",
        "Fit a model, find what it lacks, add that, and test the result on held-out runs.",
    )
)


@app.command("batch")
@console.guarded
def batch(
    studies: Annotated[list[Path], Argument(help="Study files.", show_default=False)],
    out: Annotated[
        Place, Option("--out", "-o", help="Folder for the results; default: results/batch.")
    ] = None,
    workers: Annotated[int, Option(min=1, max=1024, help="Processes on this machine.")] = 1,
    scheduler: Annotated[Text, Option(help="Address of a dask scheduler, tls://host:port.")] = None,
    seed: console.SeedOption = None,
    quiet: console.QuietOption = False,
    as_json: console.JsonOption = False,
    overwrite: console.OverwriteOption = False,
) -> None:
    """Run many studies; one that fails is listed with its reason and does not stop the rest."""
    from discover.batch.run import run_batch

    folder = out or Path("results") / "batch"
    with progress_bar(quiet) as report:
        result = run_batch(studies, folder, workers, scheduler, seed, overwrite, report)
    if as_json:
        typer.echo(json.dumps(result.to_json(), indent=2))
    elif not quiet:
        console.say(result.text())
    for study in result.failed:
        console.say_error(f"{study.name} ({study.task}): {study.text}")
    if result.failed:
        raise typer.Exit(2 if all(s.input_error for s in result.failed) else 1)


@app.command("fit")
@console.guarded
def fit(
    law: Annotated[str, Argument(help="Name of the law; see: discover laws.")],
    data: Annotated[Path, Argument(metavar="folder", help="Data folder.")],
    held_out: Annotated[Texts, Option(help="Run that only tests the fit.")] = None,
    bounds: Annotated[Texts, Option(help="Range of a constant: alpha=0:0.5.")] = None,
    start: Annotated[Texts, Option(help="Start of a constant: alpha=0.2.")] = None,
    fixed: Annotated[Texts, Option("--fix", help="Constant that is not fitted: alpha=0.2.")] = None,
    solvent: Annotated[bool, Option("--solvent", help="Also fit a solvent viscosity.")] = False,
    out: Annotated[Place, Option("--out", "-o", help="Folder for page, JSON, equation.")] = None,
    quiet: console.QuietOption = False,
    as_json: console.JsonOption = False,
    overwrite: console.OverwriteOption = False,
    tolerance: console.ToleranceOption = None,
) -> None:
    """Fit one named law: constants, intervals, correlation, and how well it describes the runs."""
    from discover.answer import TOLERANCE
    from discover.compilation_cache import enable_compilation_cache
    from discover.dataset import load_dataset
    from discover.first_use import enable_x64
    from discover.fitting import fit as fit_law

    enable_x64()
    enable_compilation_cache()
    asked = console.pairs(bounds or (), "alpha=0:0.5")
    ranges = {name: _bounds(name, text) for name, text in asked.items()}
    numbers = [
        {
            name: console.number(text, f"--{option} {name}")
            for name, text in console.pairs(given or (), "alpha=0.2").items()
        }
        for option, given in (("start", start), ("fix", fixed))
    ]
    dataset = load_dataset(data)
    found = fit_law(
        law, dataset, bounds=ranges, start=numbers[0], fixed=numbers[1],
        effects={"solvent_viscosity": "fit"} if solvent else None, held_out=held_out or (),
        tolerance=TOLERANCE if tolerance is None else tolerance,
    )  # fmt: skip
    if out is not None:
        _write(found, out, overwrite)
    if as_json:
        typer.echo(json.dumps(found.to_json(), indent=2))
    elif not quiet:
        console.say(found.text)
        if found.constants:
            console.say(found.summary().to_string(float_format="{:.4g}".format))
        if len(found.constants) > 1:
            console.say("Correlation:")
            console.say(found.correlation.to_string(float_format="{:.2f}".format))
        if out is not None:
            console.say(f"Report: {(out / 'report.html').resolve()}")


def _write(found, out: Path, overwrite: bool) -> None:
    """Write the page and its files into a folder that holds nothing else."""
    from discover.report.in_memory import fit_files, fit_page
    from discover.study.run_folder import RunFolder

    folder = RunFolder(out, json.dumps(found.to_json(), sort_keys=True), overwrite)
    for name, text in fit_files(found).items():
        folder.write(name, text)
    folder.write("report.html", fit_page(found))
    folder.finish()


def _bounds(name: str, text: str) -> tuple[float, float]:
    low, colon, high = text.partition(":")
    if not colon:
        raise InputError(f"--bounds {name} must be two numbers, low:high; got {text!r}.")
    return console.number(low, f"--bounds {name}"), console.number(high, f"--bounds {name}")


@app.command("export")
@console.guarded
def export(
    results: Annotated[Path, Argument(help="Folder of results.", show_default=False)],
    form: Annotated[
        str, Option("--format", "-f", help="python, sympy, latex, json, rheotool or ufl.")
    ] = "python",
    law: Annotated[Text, Option(help="Learner whose law to write; default: the answer's.")] = None,
    out: Annotated[Place, Option("--out", "-o", help="File; default: standard output.")] = None,
    density: Annotated[Number, Option(min=0.0, help="kg/m3, for rheotool; default: 1000.")] = None,
    tolerance: Annotated[
        Number, Option(min=0.0, max=0.5, help="For rheotool: accepted deviation; default: 0.01.")
    ] = None,
    overwrite: Annotated[bool, Option("--overwrite", help="Replace the file.")] = False,
) -> None:
    """Write the law found as Python, SymPy, LaTeX, JSON, UFL or a rheoTool dictionary."""
    from discover.answer.simple_material import simple_material_text
    from discover.equations.files import choose_law, read_result_laws, write_equation
    from discover.first_use import enable_x64
    from discover.study.atomic import make_folder, replaceable, write_text

    if density is not None and not 0.0 < density < math.inf:
        raise InputError(f"--density must be a positive number of kg/m3; got {density}. Try 1000.")
    if tolerance is not None and math.isnan(tolerance):
        raise InputError("--tolerance must be a number from 0 to 0.5; got nan. Try 0.01.")
    enable_x64()
    text = None if law is not None else simple_material_text(results, form, density)
    if text is None:
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
    console.say(f"{out} written.")


@app.command("laws")
@console.guarded
def laws(as_json: console.JsonOption = False) -> None:
    """List the laws that a study can name, including your own, with their parameters."""
    from discover.laws import laws_table

    _show(laws_table(), "title", as_json)


@app.command("effects")
@console.guarded
def effects(as_json: console.JsonOption = False) -> None:
    """List the effects that a loop can add, including your own, with their parameters."""
    from discover.effects import effects_table

    _show(effects_table(), "kind", as_json)


def _show(table: "pd.DataFrame", said: str, as_json: bool) -> None:
    """Print a table of named things, which has a line for each of their parameters."""
    table = table.reset_index(names="name")
    if as_json:
        typer.echo(table.to_json(orient="records", indent=2, force_ascii=False))
        return
    for name, lines in table.groupby("name", sort=False):
        ranges = ", ".join(_range(line) for line in lines.to_dict("records") if line["parameter"])
        console.say(f"{name:<32}{lines[said].iloc[0]:<26}{ranges or 'no parameter'}")


def _range(line: dict[Any, Any]) -> str:
    low, high = (f"{x:g}" if math.isfinite(x) else "open" for x in (line["low"], line["high"]))
    scale = str(line.get("range_scale", "one")).replace("_", " ")
    unit = "" if line["unit"] in ("", "1") else f" {line['unit']}"
    return f"{line['parameter']} ({low} to {high}{unit if scale == 'one' else f' × {scale}'})"


app.add_typer(data_app, name="data")


def _print_version(wanted: bool) -> bool:
    if wanted:
        typer.echo(f"discover {__version__}")
        raise typer.Exit
    return wanted


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and exit.", callback=_print_version)
    ] = False,
) -> None:
    del version


def _one_line(message: Warning | str, *rest: object, **options: object) -> str:
    """Return a warning as a user reads it, without the line of code that gave it."""
    del rest, options
    return f"discover: warning: {' '.join(str(message).split())}\n"


def main() -> None:
    """Run the command line."""
    sys.stdout, sys.stderr = console.heard_or_not(sys.stdout), console.heard_or_not(sys.stderr)
    keep_out_of_the_working_directory()
    warnings.formatwarning = _one_line
    # numbers that overflow in a trial: the search goes on, and a user cannot act on it
    warnings.simplefilter("ignore", RuntimeWarning)
    use_one_thread_from_the_start()
    use_the_processor_from_the_start()
    # tracing makes millions of small objects that stay, and each full collection walks all of them
    gc.set_threshold(100_000, 50, 100)
    with console.obeying_interrupts():
        try:
            app(prog_name="discover")
        finally:
            gc.freeze()  # else Python looks through all of them once more before it ends
