"""The command line as tests ask it, in this process."""

from typer.testing import CliRunner

from discover.cli import app


def invoke(*arguments, code=None):
    """Return how a command ended; fail if its exit code is another than the one given."""
    done = CliRunner().invoke(app, [str(a) for a in arguments])
    assert code is None or done.exit_code == code, done.output
    return done
