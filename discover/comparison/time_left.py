"""Time that a comparison still takes: search, learners, and what is weighed after."""

import time
from collections.abc import Callable

from discover.compilation_cache import compiled_share
from discover.loop.search_time import SearchTime
from discover.progress import Crowding, Progress, by_time

_LEARN, _WEIGH = (6.0, 20.0, 0.2), (6.5, 14.0, 0.25)
"""Seconds in which learners learn, and in which laws are weighed: a constant, and what compiling
adds, which a crowded machine prolongs, and a share of the search's. Measured on the demonstration
and on LDPE."""

_SLOWER = 2.0
"""Factor by which learning may change what is expected of weighing."""

_LEAST = 0.15
"""Share of a part's expected time that is still told of it once that time is over."""


class ComparisonTime:
    """Progress of a comparison.

    `most`, `several_modes`, `held_out`, `clock`, `crowding`: as for `SearchTime`. `compiled`: share
    of programs that have to be compiled.
    """

    def __init__(
        self,
        progress: Progress,
        most: int,
        several_modes: bool,
        held_out: bool,
        clock: Callable[[], float] = time.perf_counter,
        crowding: Callable[[], float] | None = None,
        compiled: Callable[[], float] = compiled_share,
    ):
        self._clock, self._crowding = clock, crowding or Crowding()
        self._compiled = compiled
        self._tell = by_time(progress, clock)
        self._searches = SearchTime(
            most, several_modes, held_out=held_out, reported=False, clock=clock,
            crowding=self._crowding,
        )  # fmt: skip
        self._begun = self._since = clock()
        self._search = 0.0
        self._learn = self._weigh = 0.0
        self._weighs = False

    def searching(self, line: str) -> None:
        """Pass on a line of the search, or of one after the learners."""
        if self._weighs:
            self._tell(line, max(self._weigh - self._passed, _LEAST * self._weigh))
            return
        left = self._searches.heard(line)
        if left is not None:
            self._search = self._clock() - self._begun + left
            self._expect()
            left += self._learn + self._weigh
        self._tell(line, left)

    def learning(self) -> None:
        """Begin to learn."""
        self._since = self._clock()
        self._search = self._since - self._begun
        self._expect()

    def learned(self, text: str, fraction: float) -> None:
        """Pass on what learners say; trainings end by themselves, so their fraction is no time."""
        self._expect()
        least = (1.0 - fraction) * _LEAST * self._learn
        self._tell(text, max(self._learn - self._passed, least) + self._weigh)

    def weighing(self, text: str) -> None:
        """Begin to weigh."""
        slower = self._passed / self._learn if self._learn else 1.0
        self._weighs, self._since = True, self._clock()
        if slower > 0.5 / _SLOWER:  # learners that were kept tell nothing
            self._weigh *= min(max(slower, 1.0 / _SLOWER), _SLOWER)
        self._tell(text, self._weigh)

    @property
    def _passed(self) -> float:
        return self._clock() - self._since

    def _expect(self) -> None:
        crowding = self._crowding()
        self._learn, self._weigh = (
            (kept + self._compiled() * compiling) * crowding + share * self._search
            for kept, compiling, share in (_LEARN, _WEIGH)
        )
