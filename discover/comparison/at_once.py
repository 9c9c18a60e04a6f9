"""Independent parts of a comparison at the same time, told of by the thread that asked for them."""

import queue
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from threading import Event
from typing import TypeVar

from discover.progress import Progress, Stopped, may_be_stopped

R = TypeVar("R")

_LOOK_UP = 0.5  # seconds, for an interrupt on systems where a wait cannot be interrupted


def at_once(parts: Mapping[str, Callable[[Progress], R]], progress: Progress) -> dict[str, R]:
    """Return what each part returns, all of them computed side by side.

    A part that is compiled or integrated leaves Python to the others. What each says of its
    progress is passed on in the thread of the caller, with the mean of their fractions, so that
    whoever listens need not know of threads. If one fails, or the caller is interrupted, the others
    end where they next ask or say something.

    `parts`: each takes what it tells of its progress; none may depend on another. `progress`:
    called with the name of a part and what it says.
    """
    if len(parts) < 2:
        return {name: part(_named(name, progress)) for name, part in parts.items()}
    told: queue.SimpleQueue[tuple[str, str, float] | Future[R]] = queue.SimpleQueue()
    stop, fractions = Event(), dict.fromkeys(parts, 0.0)

    def run(name: str, part: Callable[[Progress], R]) -> R:
        def say(text: str, fraction: float) -> None:
            if stop.is_set():
                raise Stopped
            told.put((name, text, fraction))

        with may_be_stopped(stop):
            return part(say)

    with ThreadPoolExecutor(len(parts)) as pool:
        try:
            futures = {name: pool.submit(run, name, part) for name, part in parts.items()}
            for future in futures.values():
                future.add_done_callback(told.put)
            running = len(futures)
            while running:
                try:
                    one = told.get(timeout=_LOOK_UP)
                except queue.Empty:
                    continue
                if isinstance(one, Future):
                    one.result()  # or what it failed with
                    running -= 1
                    continue
                name, text, fraction = one
                fractions[name] = max(fractions[name], fraction)
                progress(f"{name}: {text}", sum(fractions.values()) / len(fractions))
        except BaseException:
            stop.set()
            raise
    return {name: future.result() for name, future in futures.items()}


def _named(name: str, progress: Progress) -> Progress:
    return lambda text, fraction: progress(f"{name}: {text}", fraction)
