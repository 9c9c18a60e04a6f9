"""Time that a comparison still takes: search, learners, and what is weighed after."""

import time

from discover.loop.search_time import SearchTime
from discover.progress import Progress, by_time

_LEARN, _WEIGH = (5.0, 0.2), (6.0, 0.25)
"""Seconds in which learners learn, and in which laws are weighed: a constant, and a share of the
search's. Measured on the demonstration and on LDPE."""

_LEAST = 0.15
"""Share of a part's expected time that is still told of it once that time is over."""


class ComparisonTime:
    """Progress of a comparison.

    `most`, `several_modes`, `held_out`: as for `SearchTime`. `trainings`: how often all learners
    learn.
    """

    def __init__(
        self,
        progress: Progress,
        most: int,
        several_modes: bool,
        held_out: bool,
        trainings: float,
    ):
        self._tell, self._trainings = by_time(progress), trainings
        self._searches = SearchTime(most, several_modes, held_out=held_out, reported=False)
        self._begun = self._since = time.perf_counter()
        self._learn = self._weigh = 0.0
        self._weighs = False

    def searching(self, line: str) -> None:
        """Pass on a line of the search, or of one after the learners."""
        if self._weighs:
            self._tell(line, max(self._weigh - self._passed, _LEAST * self._weigh))
            return
        left = self._searches.heard(line)
        if left is not None:
            self._expect(time.perf_counter() - self._begun + left)
            left += self._learn + self._weigh
        self._tell(line, left)

    def learning(self) -> None:
        """Begin to learn."""
        now = time.perf_counter()
        self._expect(now - self._begun)
        self._since = now

    def learned(self, text: str, fraction: float) -> None:
        """Pass on what learners say; trainings end by themselves, so their fraction is no time."""
        least = (1.0 - fraction) * _LEAST * self._learn
        self._tell(text, max(self._learn - self._passed, least) + self._weigh)

    def weighing(self, text: str) -> None:
        """Begin to weigh."""
        self._weighs, self._since = True, time.perf_counter()
        self._tell(text, self._weigh)

    @property
    def _passed(self) -> float:
        return time.perf_counter() - self._since

    def _expect(self, search: float) -> None:
        learn, self._weigh = (constant + share * search for constant, share in (_LEARN, _WEIGH))
        self._learn = learn * self._trainings
