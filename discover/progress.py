"""Progress of everything that takes long."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import cache
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


def rising(progress: Progress | None) -> Progress:
    """Return what passes lines on with the largest fraction so far."""
    largest = 0.0

    def say(text: str, fraction: float) -> None:
        nonlocal largest
        largest = max(largest, min(fraction, 1.0))
        (progress or silent)(text, largest)

    return say


_STEPS, _TIMES = 50_000, 5
_REFERENCE = 0.0010
"""Steps of a piece of work, how often it is done, and its seconds where those of this software were
measured."""


@cache
def slowness() -> float:
    """Return the time that this machine takes for a piece of work over that of the reference."""
    times = []
    for _ in range(_TIMES):
        begun, total = time.perf_counter(), 0  # a processor's time may tick in hundredths
        for step in range(_STEPS):
            total += step & 7
        times.append(time.perf_counter() - begun)
    return min(times) / _REFERENCE


class FollowedBy:
    """Progress of a part, after which others take so many seconds on the machine of `slowness`."""

    def __init__(
        self,
        progress: Progress | None,
        seconds: float,
        clock: Callable[[], float] = time.perf_counter,
        slow: Callable[[], float] | None = None,
    ):
        self._progress, self._clock, self._slow = progress, clock, slow or slowness
        self._largest = 0.0
        self.expect(seconds)

    def expect(self, seconds: float) -> None:
        """Begin another part, which others take so long after."""
        self._seconds, self._begun, self._before = seconds, self._clock(), self._largest

    def __call__(self, text: str, fraction: float) -> None:
        """Pass on a line, with the fraction of all time."""
        if fraction > 0.0:
            passed = self._clock() - self._begun
            fraction = passed / max(passed / fraction + self._seconds * self._slow(), 1e-9)
        whole = self._before + (1.0 - self._before) * fraction
        self._largest = max(self._largest, whole)
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
    tell = rising(progress)

    def say(step: int, total: int, loss: float) -> None:
        tell(f"step {step} of at most {total}, loss {loss:.2g}", step / max(total, 1))

    return say


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
