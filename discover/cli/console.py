"""What a terminal shows: lines that it cannot obey, and progress with the time left."""

import errno
import functools
import io
import math
import os
import signal
import socket
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Annotated, Any

import typer
from typer import Argument, Option

from discover.errors import InputError, plain_os_error, problems_in
from discover.inputs_kept import inputs_kept
from discover.progress import on_stop, resumable, run_stop_callbacks

Report = Callable[[str, float], None]


_LONGEST = 400  # characters of a word, such as a path, that a message repeats


class _HeardOrNot(io.FileIO):
    """A stream of the system's that goes on as if heard when nobody reads it any more."""

    def write(self, data, /):
        try:
            return super().write(data)
        except OSError as error:
            # what is left in buffers goes nowhere, and does not fail once more at the end
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self.fileno())
            os.close(nowhere)
            if not isinstance(error, BrokenPipeError):
                raise  # such as a full disk
            return len(data)


def heard_or_not(stream: Any) -> Any:
    """Return a standard stream that spells out unknown characters, and lets its reader leave."""
    if not isinstance(stream, io.TextIOWrapper):  # somebody's own, or none at all
        return stream
    try:
        stream.flush()
        raw = _HeardOrNot(stream.fileno(), "wb", closefd=False)
    except (OSError, ValueError):  # no file of the system's
        stream.reconfigure(errors="backslashreplace")
        return stream
    return io.TextIOWrapper(
        io.BufferedWriter(raw),
        encoding=stream.encoding,
        errors="backslashreplace",
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )


def say(text: str, err: bool = False) -> None:
    """Print lines that may quote files: without characters that a terminal would obey."""
    shown = (c if c.isprintable() or c == "\n" else "\N{REPLACEMENT CHARACTER}" for c in text)
    typer.echo("".join(shown), err=err)


def say_error(message: str) -> None:
    """Print on standard error what a command ends with: one line, or one for each problem."""
    head, *others = [message.partition("\n")[0], *problems_in(message)]
    lines = [f"discover: {_one_line(head)}", *(f"  - {_one_line(one)}" for one in others)]
    say("\n".join(lines if len(lines) > 2 else [f"discover: {_one_line(message)}"]), err=True)


def _one_line(text: str) -> str:
    words = (word if len(word) <= _LONGEST else f"{word[:_LONGEST]}…" for word in text.split())
    return " ".join(words)


@contextmanager
def progress_bar(quiet: bool) -> Iterator[Report]:
    """Yield a function of what goes on and the fraction done; silent if `quiet` or no terminal."""
    from rich.console import Console

    console = Console(stderr=True)
    if quiet or not console.is_terminal:
        yield lambda label, fraction: None
        return
    from rich import progress
    from rich.markup import escape

    columns = (
        progress.BarColumn(bar_width=24),
        progress.TextColumn("{task.percentage:3.0f} %, "),
        progress.TimeElapsedColumn(),
        progress.TextColumn("and about"),
        progress.TimeRemainingColumn(compact=True),
        progress.TextColumn("left: {task.description}"),
    )
    # fractions are of time: the whole course tells the time left, not its last seconds
    bar = progress.Progress(
        *columns, console=console, transient=True, speed_estimate_period=math.inf
    )
    with bar, on_stop(bar.stop):
        task = bar.add_task("starting", total=1.0)
        yield lambda label, f: bar.update(task, completed=f, description=escape(label[:70]))


def interrupted() -> str:
    """Return what Ctrl-C leaves: of a command that has no folder yet, nothing."""
    kept = " What was finished is kept; to go on from there, run the same command again."
    return f"interrupted.{kept if resumable.is_set() else ''}"


INTERRUPTED_CODE = 128 + signal.SIGINT
"""Exit code of a program that Ctrl-C ended, as shells know it."""

_PATIENCE = 4.0  # seconds for last words


@contextmanager
def obeying_interrupts() -> Iterator[None]:
    """End the process within about a second of Ctrl-C, with one line and `INTERRUPTED_CODE`.

    Python raises between two instructions of the main thread alone: never while a program compiles.
    So a thread listens. Nothing outside the main thread, or where the signal is handled already.
    """
    main = threading.current_thread() is threading.main_thread()
    if not main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    ear, mouth = socket.socketpair()
    mouth.setblocking(False)  # as set_wakeup_fd demands
    pressed = 0

    def note(number: int, frame: object) -> None:
        nonlocal pressed
        pressed += 1
        if pressed > 1:  # no patience even for last words
            _leave()
        threading.Event().wait()  # what the last words stop is no news to act upon

    def listen() -> None:
        while heard := ear.recv(1):
            if heard[0] == signal.SIGINT:
                # the main thread may have stopped where it holds what these want
                words = threading.Thread(target=run_stop_callbacks, daemon=True)
                words.start()
                words.join(_PATIENCE)
                _leave()
        ear.close()

    # the wake-up comes first: a signal between the two lines would be noted and not heard
    descriptor = signal.set_wakeup_fd(mouth.fileno(), warn_on_full_buffer=False)
    signal.signal(signal.SIGINT, note)
    threading.Thread(target=listen, name="Ctrl-C", daemon=True).start()
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.set_wakeup_fd(descriptor)
        mouth.close()


def _leave() -> None:
    say_error(interrupted())
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):  # a pipe that nobody reads any more
            stream.flush()
    os._exit(INTERRUPTED_CODE)


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
            _fail(interrupted(), INTERRUPTED_CODE)
        except Exception as error:
            if os.environ.get(DEBUG_VARIABLE):
                raise
            if isinstance(error, OSError):
                # a name that no file can have is the user's
                _fail(plain_os_error(error), 2 if error.errno == errno.ENAMETOOLONG else 1)
            said = f"{type(error).__name__}: {(str(error).splitlines() or [''])[0]}"
            remedy = f"set {DEBUG_VARIABLE}=1 for the traceback"
            _fail(f"{said} (not your input's fault; {remedy})", 1)

    return run


def _fail(message: str, code: int) -> None:
    say_error(message)
    raise typer.Exit(code)


def pairs(given: Iterable[str], example: str) -> dict[str, str]:
    """Return what options say that are written NAME=VALUE; InputError where one is not."""
    found = {}
    for option in given:
        key, equals, value = option.partition("=")
        if not equals or not key.strip() or not value.strip():
            raise InputError(f"Cannot read {option!r}; write it as name=value, such as {example}.")
        found[key.strip()] = value.strip()
    return found


def number(text: str, where: str) -> float:
    """Return the number of an option; InputError, which names it, where it is none."""
    from discover.dataset.tables.table import is_number

    # float() also reads 1_2, nan and digits of other scripts
    if not is_number(text):
        raise InputError(f"{where} must be a number; got {text!r}. Write it as 25 or 0.5.")
    return float(text)


Text = str | None
Texts = list[str] | None
"""An option that may be given several times."""
Number = float | None
Place = Path | None
StudyArgument = Annotated[
    Path, Argument(help="Study file (TOML); discover data import writes one.", show_default=False)
]
OutOption = Annotated[
    Place, Option("--out", "-o", help="Folder for the results; default: results/STUDY.")
]
SeedOption = Annotated[
    int | None,
    Option(min=0, max=2**32 - 1, help="Seed of noise and learners, in place of the study's."),
]
QuietOption = Annotated[bool, Option("--quiet", "-q", help="Print no progress and no summary.")]
JsonOption = Annotated[bool, Option("--json", help="Print the result as JSON.")]
OverwriteOption = Annotated[bool, Option("--overwrite", help="Start again instead of resuming.")]
ToleranceOption = Annotated[
    Number, Option(help="Relative misfit that you accept; default: the study's, or 0.05.")
]
