"""What a command leaves behind that does not end as it should: one line, and a code."""

import pytest
import typer
from typer.testing import CliRunner

from discover.cli.console import guarded
from discover.errors import InputError


def ended_with(error):
    app = typer.Typer()

    @app.command()
    @guarded
    def command() -> None:
        raise error

    return CliRunner().invoke(app, [])


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (KeyboardInterrupt(), 130, "run the same command again"),
        (InputError("there is no run 'a'"), 2, "there is no run 'a'"),
        (PermissionError(13, "Permission denied", "out"), 1, "out"),
        (
            RuntimeError("it broke\nin two lines"),
            1,
            "RuntimeError: it broke (not your input's fault",
        ),
    ],
)
def test_each_end_has_a_code_of_its_own_and_says_what_to_do(error, code, said, monkeypatch):
    monkeypatch.delenv("DISCOVER_DEBUG", raising=False)
    done = ended_with(error)
    assert done.exit_code == code
    assert said in done.stderr
    assert done.stderr.strip().count("\n") == 0
    assert done.stdout == ""


def test_a_command_that_ends_well_says_nothing():
    done = ended_with(typer.Exit())
    assert (done.exit_code, done.output) == (0, "")
