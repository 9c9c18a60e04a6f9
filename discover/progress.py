"""Progress of everything that takes long."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
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
    """End of work that nobody waits for any more; no error, so that nothing takes it for one."""


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


def by_time(
    progress: Progress | None, clock: Callable[[], float] = time.perf_counter
) -> Callable[..., None]:
    """Return what passes on lines with the seconds to come, as the fraction of all time.

    It never falls, and is zero while the seconds are not known (None).
    """
    begun = progress.begun if isinstance(progress, FollowedBy) else clock()
    largest = 0.0

    def say(text: str, left: float | None) -> None:
        nonlocal largest
        passed = clock() - begun
        if left is not None:
            largest = max(largest, min(passed / max(passed + left, 1e-9), 1.0))
        (progress or silent)(text, largest)

    return say


class Crowding:
    """How much longer this process takes than alone: its time on the clock over its processors'.

    One at least, which other processes raise that want the same cores. Counted from the beginning.
    """

    def __init__(
        self,
        clock: Callable[[], float] = time.perf_counter,
        processor: Callable[[], float] = time.process_time,
    ):
        self._clock, self._processor = clock, processor
        self._begun = clock(), processor()

    def __call__(self) -> float:
        """Return the factor so far."""
        passed, worked = self._clock() - self._begun[0], self._processor() - self._begun[1]
        return max(1.0, passed / worked) if worked > _TELLING else 1.0


_TELLING = 0.2
"""Seconds of the processor that tell how crowded a machine is."""


class FollowedBy:
    """Progress of a part from the beginning, after which others take so many seconds.

    `seconds`: on a machine of its own. `crowding`: how much longer it takes.
    """

    def __init__(
        self,
        progress: Progress | None,
        seconds: float,
        clock: Callable[[], float] = time.perf_counter,
        crowding: Callable[[], float] | None = None,
    ):
        self._progress, self._seconds, self._clock = progress, seconds, clock
        self._crowding = crowding or Crowding()
        self.begun = progress.begun if isinstance(progress, FollowedBy) else clock()
        self._largest = 0.0

    def expect(self, seconds: float) -> None:
        """Set how long others take after the part that begins now; its time counts from before."""
        self._seconds = seconds

    def __call__(self, text: str, fraction: float) -> None:
        """Pass on a line, with the fraction of all time."""
        if fraction > 0.0:
            passed = self._clock() - self.begun
            fraction = passed / (passed / fraction + self._seconds * self._crowding())
        self._largest = max(self._largest, fraction)
        (self._progress or silent)(text, self._largest)


def by_lines(progress: Progress | None, expected: int) -> Callable[[str], None]:
    """Return what passes lines on, each as one of about so many; the fraction stays below 0.95."""
    lines = 0

    def say(line: str) -> None:
        nonlocal lines
        lines += 1
        (progress or silent)(line, min(lines / (expected + 1), 0.95))

    return say


def by_steps(progress: Progress | None) -> Callable[[int, int, float], None]:
    """Return what passes on steps of at most so many, with their loss; the fraction never falls."""
    largest = 0.0

    def say(step: int, total: int, loss: float) -> None:
        nonlocal largest
        largest = max(largest, step / max(total, 1))
        (progress or silent)(f"step {step} of at most {total}, loss {loss:.2g}", largest)

    return say


resumable = Event()
"""Set once there is a folder from which the same command goes on."""

_registered: list[Callable[[], object]] = []


@contextmanager
def on_stop(callback: Callable[[], object]) -> Iterator[None]:
    """Have a function called if the program is stopped while the context lasts.

    Whatever stops the program calls `run_stop_callbacks`, from a thread of its own.
    """
    _registered.append(callback)
    try:
        yield
    finally:
        _registered.remove(callback)


def run_stop_callbacks() -> None:
    """Call what is registered, the last first; one that fails does not stop the others."""
    for callback in reversed(_registered):
        with suppress(Exception):
            callback()
