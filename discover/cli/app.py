"""All commands in one place; nothing heavy is imported before a command runs."""

import gc
import sys
import warnings
from typing import Annotated

import typer

from discover._version import __version__
from discover.accelerators import use_the_processor_from_the_start
from discover.cli.console import heard_or_not, obeying_interrupts
from discover.cli.data_commands import data_app
from discover.cli.law_commands import effects, export, fit, laws
from discover.cli.study_commands import batch, close_loop, compare, demo
from discover.linear_algebra_threads import use_one_thread_from_the_start
from discover.report.plots import keep_out_of_the_working_directory

app = typer.Typer(
    name="discover",
    help="Find the constitutive equation of a viscoelastic fluid from rheometer data, and say "
    "what the data can and cannot tell. To begin: discover demo",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


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
