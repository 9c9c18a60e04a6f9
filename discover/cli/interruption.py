"""Ctrl-C that is obeyed at once, whatever is going on."""

import os
import signal
import socket
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from discover.cli.console import say_error
from discover.stop_callbacks import run_stop_callbacks

INTERRUPTED = (
    "interrupted. What was finished is kept; to go on from there, run the same command again."
)
INTERRUPTED_CODE = 128 + signal.SIGINT
"""Exit code of a program that Ctrl-C ended, as shells know it."""

_PATIENCE = 4.0  # seconds for last words


@contextmanager
def obeying_interrupts() -> Iterator[None]:
    """End the process within about a second of Ctrl-C, with one line and `INTERRUPTED_CODE`.

    Python alone raises an exception in the main thread between two of its instructions. While a
    program is compiled there is none for many seconds, pools of threads are waited for, and where
    the exception meets a library's callback it is lost. So a thread of its own listens here, has
    the last words said and ends the process. Files are whole or absent at any time, so nothing
    else has to be put in order.

    Does nothing outside the main thread, and where somebody else handles the signal already.
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
    say_error(INTERRUPTED)
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):  # a pipe that nobody reads any more
            stream.flush()
    os._exit(INTERRUPTED_CODE)
