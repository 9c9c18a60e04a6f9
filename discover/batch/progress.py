"""How far a batch is, from how far its studies are."""

from collections.abc import Callable
from threading import Lock
from time import monotonic

from discover.batch.status import StudyStatus
from discover.progress import Progress

_PAUSE = 1.0  # seconds between two lines of one study that a worker sends


class BatchProgress:
    """Adds up studies that run side by side or one after the other.

    Studies whose result was there already do not count: time left is estimated from the fraction
    done, and finding a result takes no time.

    `progress`: called with what is going on and the fraction done.
    """

    def __init__(self, names: list[str], progress: Progress):
        self._names = names
        self._progress = progress
        self._fractions = [0.0] * len(names)
        self._ended: dict[int, StudyStatus] = {}
        self._lock = Lock()  # news from workers comes in a thread of its own

    def say(self, position: int, label: str, fraction: float) -> None:
        """Take note of how far a study is; news that a study has outrun is passed over."""
        with self._lock:
            if position in self._ended:
                return
            self._fractions[position] = max(self._fractions[position], fraction)
            self._report(position, label)

    def end(self, position: int, status: StudyStatus) -> None:
        """Take note of a study that has ended."""
        with self._lock:
            self._ended[position] = status
            self._fractions[position] = 1.0
            self._report(position, status.status)

    def _report(self, position: int, label: str) -> None:
        there = [i for i, status in self._ended.items() if status.status == "complete"]
        to_do = len(self._names) - len(there)
        fraction = (sum(self._fractions) - len(there)) / to_do if to_do else 1.0
        ended = f"{len(self._ended)} of {len(self._names)} ended"
        self._progress(f"{ended}; {self._names[position]}: {label}", fraction)


def now_and_then(send: Callable[[str, float], None], pause: float = _PAUSE) -> Progress:
    """Return a progress function that passes on at most one line in so many seconds."""
    latest = -pause

    def say(label: str, fraction: float) -> None:
        nonlocal latest
        if monotonic() - latest >= pause:
            latest = monotonic()
            send(label, fraction)

    return say
