"""Commands that run studies: demo, compare, close-loop, batch."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from discover.cli import console
from discover.cli.console import progress_bar


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
    "run_compare", "Run both learners on the same data and write a comparison report."
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
