"""What a terminal shows: lines that it cannot obey, and progress with the time left."""

import io
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import typer

from discover.errors import problems_in
from discover.stop_callbacks import on_stop

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
    """Return a standard stream that takes any character, and lets its reader leave early.

    What ``| head`` does not want to see is no reason to leave files unwritten, or for another exit
    code. Characters that a terminal does not know, such as σ, or half of one in a file's name, are
    spelled out.
    """
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
    typer.echo("\n".join(map(_plain, text.split("\n"))), err=err)


def say_error(message: str) -> None:
    """Print on standard error what a command ends with: one line, or one for each problem."""
    head, *others = [message.partition("\n")[0], *problems_in(message)]
    lines = [f"discover: {_one_line(head)}", *(f"  - {_one_line(one)}" for one in others)]
    say("\n".join(lines if len(lines) > 2 else [f"discover: {_one_line(message)}"]), err=True)


def _one_line(text: str) -> str:
    words = (word if len(word) <= _LONGEST else f"{word[:_LONGEST]}…" for word in text.split())
    return " ".join(words)


def _plain(line: str) -> str:
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in line)


@contextmanager
def progress_bar(quiet: bool) -> Iterator[Report]:
    """Yield a function of what is going on and the fraction done, 0 to 1.

    Draws nothing when `quiet`, or when standard error is not a terminal.
    """
    from rich.console import Console

    console = Console(stderr=True)
    if quiet or not console.is_terminal:
        yield lambda label, fraction: None
        return
    from rich.markup import escape
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        BarColumn(bar_width=24),
        TextColumn("{task.percentage:3.0f} %"),
        TimeElapsedColumn(),
        TextColumn("{task.fields[left]}"),
        TextColumn("{task.description}"),
    )
    with Progress(*columns, console=console, transient=True) as bar, on_stop(bar.stop):
        task = bar.add_task("starting", total=1.0, left="")

        def report(label: str, fraction: float) -> None:
            elapsed = bar.tasks[0].elapsed or 0.0
            # parts differ in speed: the mean so far is steadier than the latest speed
            left = elapsed * (1.0 - fraction) / fraction if fraction > 0.02 else None
            text = "" if left is None or fraction >= 1.0 else f"about {_duration(left)} left"
            bar.update(task, completed=fraction, description=escape(label[:70]), left=text)

        yield report


def _duration(seconds: float) -> str:
    if seconds < 60:
        return f"{max(seconds, 1):.0f} s"
    if seconds < 3600:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"
