"""What is still done when a program is told to stop at once."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

_registered: list[Callable[[], object]] = []


@contextmanager
def on_stop(callback: Callable[[], object]) -> Iterator[None]:
    """Have a function called if the program is stopped while the context lasts.

    Whatever decides to stop the program calls `run_stop_callbacks`, from a thread of its own.
    Nothing is called if the context ends by itself.
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
