"""What a terminal shows: lines that it cannot obey, and progress with the time left."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import typer

from discover.stop_callbacks import on_stop

Report = Callable[[str, float], None]


_LONGEST = 400  # characters of a word, such as a path, that a message repeats


def say(text: str, err: bool = False) -> None:
    """Print lines that may quote files: without characters that a terminal would obey."""
    typer.echo("\n".join(map(_plain, text.split("\n"))), err=err)


def say_error(message: str) -> None:
    """Print one line on standard error, as every failure of a command ends."""
    words = (word if len(word) <= _LONGEST else f"{word[:_LONGEST]}…" for word in message.split())
    say(f"discover: {' '.join(words)}", err=True)


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
