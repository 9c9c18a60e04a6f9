"""One shape of progress, for everything that takes long."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from threading import Event

from discover.errors import InputError

Progress = Callable[[str, float], None]
"""Called with what is going on, a line of text, and the fraction done, which never falls."""


def silent(text: str, fraction: float) -> None:
    """Report nothing."""
    del text, fraction


def checked(progress: Progress | None) -> Progress | None:
    """Return what is to be told of progress, if it can be."""
    if progress is None or callable(progress):
        return progress
    raise InputError(
        "progress must be a function of a text and the fraction done, such as "
        f"lambda text, fraction: print(text); got {progress!r}."
    )


class Stopped(BaseException):
    """What ends work that nobody waits for any more; no error, so that nothing takes it for one."""


_stop: ContextVar[Event | None] = ContextVar("stop", default=None)


@contextmanager
def may_be_stopped(stop: Event) -> Iterator[None]:
    """Let what this thread does be ended by an event, where it asks `require_wanted`."""
    before = _stop.set(stop)
    try:
        yield
    finally:
        _stop.reset(before)


def require_wanted() -> None:
    """Go on only if somebody still waits for what this thread computes."""
    stop = _stop.get()
    if stop is not None and stop.is_set():
        raise Stopped


def by_lines(progress: Progress | None, expected: int) -> Callable[[str], None]:
    """Return what passes lines on, each as one of about so many.

    How many there will be is not known beforehand, so the fraction stays below 0.95.
    """
    lines = 0

    def say(line: str) -> None:
        nonlocal lines
        lines += 1
        (progress or silent)(line, min(lines / (expected + 1), 0.95))

    return say


def by_steps(progress: Progress | None) -> Callable[[int, int, float], None]:
    """Return what passes on steps of at most so many, with their loss.

    Of trainings one after another, the fraction is the largest so far.
    """
    largest = 0.0

    def say(step: int, total: int, loss: float) -> None:
        nonlocal largest
        largest = max(largest, step / max(total, 1))
        (progress or silent)(f"step {step} of at most {total}, loss {loss:.2g}", largest)

    return say
