"""Time that searches still take, told from the hypotheses fitted so far."""

import re
import time
from collections.abc import Callable

_DEEPER, _EXCHANGED, _WEIGHED, _CURVES, _BANDS = 24.0, 70.0, 90.0, 38.0, 40.0
"""Parts of a search, in fits of one hypothesis: those of each further effect; those of exchanged
effects; what is weighed after them; curves of one variable; bands, intervals and the next test.
Measured on LDPE, a polyisoprene melt, a gel and two-mode PTT: 90 is 60 to 130."""

_SHARES = {_WEIGHED: 0.75, _CURVES: 0.5, _BANDS: 0.7}
"""Most that each of the last three is of the search before it. Measured on blood with few effects,
whose search was 28 fits: 0.87, 0.53 and 0.74."""

_DEEPER_EACH = 2.0
"""Most fits of each further effect, for one candidate."""

_EXCHANGE = 1.4
"""Fits of one hypothesis that an exchanged one takes."""


class SearchTime:
    """Seconds left of searches one after another, by their lines.

    `most`: largest number of effects. `several_modes`: whether a search with constants that differ
    from mode to mode may follow. `rounds`: how often all of it is done, each time with another run
    left out. `reported`: whether curves, bands and the next test belong to it. `clock`: seconds
    now.
    """

    def __init__(
        self,
        most: int,
        several_modes: bool,
        rounds: int = 1,
        reported: bool = True,
        clock: Callable[[], float] = time.perf_counter,
    ):
        self._most, self._several_modes, self._clock = most, several_modes, clock
        self._rounds, self._reported = rounds, reported
        self._begun: float | None = None
        self._searches = 0  # of this round
        self._done = self._before = 0.0  # fits, and those before this search
        self._rest = self._after = 0.0  # of this search, and of what is reported after it
        self._fitted, self._exchanged = 0.0, -1.0  # hypotheses of this search
        self._depth, self._deeper, self._size = 0, _DEEPER, 0.0
        self._first = self._round_before = 0.0
        self._reports = False

    def heard(self, line: str) -> float | None:
        """Return the seconds left after a line of the search; None before anything was fitted."""
        if found := re.search(r"search among (\d+)", line):
            self._search(float(found[1]))
        elif found := re.search(r"sets of (\d+): (\d+) fitted", line):
            self._depth = int(found[1])
            self._spend(float(found[2]))
            self._fitted += float(found[2])
            self._expect(self._deeper * (self._most - self._depth) + self._exchanged)
        elif found := re.search(r"exchanged: (\d+)", line):
            exchanged = _EXCHANGE * max(float(found[1]) - self._fitted, 0.0)
            self._spend(exchanged)
            self._expect(0.0)
            # the next one goes as far
            self._most, self._exchanged = self._depth, exchanged
        elif "from mode to mode" in line:
            self._spend(self._rest)
            self._first = self._done - self._before
        elif "curves of" in line:
            self._spend(self._rest)
            self._searches = 2  # there is no other one
        elif "bands" in line and self._after:
            self._done += self._of(_CURVES)
            self._after = self._of(_BANDS)
            self._reports = True
        if self._begun is None or not self._done:
            return None
        left = self._rest + self._after
        if self._several_modes and self._searches < 2:
            left += self._first or self._done - self._before + self._rest
        left += (self._rounds - 1) * (self._done - self._round_before + left)
        return (self._clock() - self._begun) / self._done * left

    def _search(self, candidates: float) -> None:
        """Begin a search, or a round."""
        self._begun = self._clock() if self._begun is None else self._begun
        if self._reports:
            self._done, self._reports = self._done + self._after, False
            self._rounds, self._searches, self._round_before = self._rounds - 1, 0, self._done
        self._searches, self._before, self._fitted = self._searches + 1, self._done, 0.0
        if self._exchanged < 0.0:
            self._exchanged = min(_EXCHANGED, 2.0 * candidates)
        self._deeper = min(_DEEPER, _DEEPER_EACH * candidates)
        self._expect(candidates + self._deeper * max(self._most - 1, 0) + self._exchanged)

    def _expect(self, fits: float) -> None:
        """Set what is to come of this search, so many fits and what follows them."""
        self._size = self._done - self._before + fits
        self._rest = fits + self._of(_WEIGHED)
        self._after = self._of(_CURVES) + self._of(_BANDS) if self._reported else 0.0

    def _of(self, part: float) -> float:
        return min(part, _SHARES[part] * self._size)

    def _spend(self, fits: float) -> None:
        self._done, self._rest = self._done + fits, 0.0
