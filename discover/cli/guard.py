"""What a command does when something goes wrong: one line, and an exit code that says whose fault.

0 done; 2 the user's input is wrong; 130 interrupted; 1 anything else.
"""

import functools
import os
from collections.abc import Callable

import typer

from discover.cli.console import say_error
from discover.cli.interruption import INTERRUPTED, INTERRUPTED_CODE
from discover.errors import InputError, plain_os_error
from discover.inputs_kept import inputs_kept

DEBUG_VARIABLE = "DISCOVER_DEBUG"
"""Environment variable that lets tracebacks through, for those who mend the software."""


def guarded(command: Callable[..., None]) -> Callable[..., None]:
    """Return the command with its errors turned into a message and an exit code."""

    @functools.wraps(command)
    def run(*args, **kwargs) -> None:
        try:
            with inputs_kept():
                command(*args, **kwargs)
        except (typer.Exit, typer.Abort):
            raise
        except InputError as error:
            _fail(str(error), 2)
        except KeyboardInterrupt:
            _fail(INTERRUPTED, INTERRUPTED_CODE)
        except OSError as error:
            if os.environ.get(DEBUG_VARIABLE):
                raise
            _fail(plain_os_error(error), 1)
        except Exception as error:
            if os.environ.get(DEBUG_VARIABLE):
                raise
            first = (str(error).splitlines() or [""])[0]
            _fail(
                f"{type(error).__name__}: {first} (not your input's fault; set {DEBUG_VARIABLE}=1 "
                "for the traceback)",
                1,
            )

    return run


def _fail(message: str, code: int) -> None:
    say_error(message)
    raise typer.Exit(code)
