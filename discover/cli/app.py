"""All commands in one place; those that run studies. Nothing heavy is imported before one runs."""

import gc
import json
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from discover._version import __version__
from discover.cli import console
from discover.cli.console import heard_or_not, obeying_interrupts, progress_bar
from discover.cli.data_commands import data_app
from discover.cli.law_commands import effects, export, fit, laws
from discover.processor import use_one_thread_from_the_start, use_the_processor_from_the_start
from discover.report.plots import keep_out_of_the_working_directory

app = typer.Typer(
    name="discover",
    help="Find the constitutive equation of a viscoelastic fluid from rheometer data, and say "
    "what the data can and cannot tell. To begin: discover demo",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


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


compare = _command(
    "run_compare",
    "Fit the data with sparse regression and a neural network; compare both laws.",
)
close_loop = _command(
    "run_close_loop",
    "Fit a model, find what it lacks, add that, and test the result on held-out runs.",
)


@console.guarded
def batch(
    studies: Annotated[list[Path], Argument(help="Study files.", show_default=False)],
    out: Annotated[
        Path | None, Option("--out", "-o", help="Folder for the results; default: results/batch.")
    ] = None,
    workers: Annotated[
        int, Option(min=1, max=1024, help="Number of processes on this machine.")
    ] = 1,
    scheduler: Annotated[
        str | None, Option(help="Address of a dask scheduler, tls://host:port.")
    ] = None,
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


app.command("demo")(demo)
app.command("compare")(compare)
app.command("close-loop")(close_loop)
app.command("batch")(batch)
app.command("fit")(fit)
app.command("export")(export)
app.command("laws")(laws)
app.command("effects")(effects)
app.add_typer(data_app, name="data")


def _one_line(message: Warning | str, *rest: object, **options: object) -> str:
    """Return a warning as a user reads it, without the line of code that gave it."""
    del rest, options
    return f"discover: warning: {' '.join(str(message).split())}\n"


def main() -> None:
    """Run the command line."""
    sys.stdout, sys.stderr = heard_or_not(sys.stdout), heard_or_not(sys.stderr)
    keep_out_of_the_working_directory()
    warnings.formatwarning = _one_line
    # numbers that overflow in a trial: the search goes on, and a user cannot act on it
    warnings.simplefilter("ignore", RuntimeWarning)
    use_one_thread_from_the_start()
    use_the_processor_from_the_start()
    # tracing makes millions of small objects that stay, and each full collection walks all of them
    gc.set_threshold(100_000, 50, 100)
    with obeying_interrupts():
        try:
            app(prog_name="discover")
        finally:
            gc.freeze()  # else Python looks through all of them once more before it ends
