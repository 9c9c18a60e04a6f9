"""Time that searches still take, by the hypotheses fitted so far, and a comparison around one."""

import re
import time
from collections.abc import Callable
from typing import NamedTuple

from discover.compilation_cache import compiled_share
from discover.effects.registry import built_in_effects, named_effects
from discover.forward.declared import may_differ_by_mode
from discover.progress import Crowding, Progress, by_time


class _Part(NamedTuple):
    """What follows a search: fits of one hypothesis and seconds besides.

    `compiling`: further seconds where all its programs are compiled. `share`: most of its fits over
    those of the search.
    """

    fits: float
    seconds: float = 0.0
    compiling: float = 0.0
    share: float = 1.0


# Fits of each further effect and of exchanged effects: at most so many, and for one candidate
_DEEPER, _EXCHANGED, _EACH = 24.0, 50.0, 2.0
# Fit of one effect over one of several; fits of an exchanged hypothesis
_FIRST, _EXCHANGE = 1.2, 1.4
# What is weighed after the search: with runs held out, when all are fitted again, or without
_WEIGHED, _WEIGHED_ALONE = _Part(175.0, share=1.05), _Part(15.0)
# Curves of one variable; bands, intervals and the next test. All these were measured on two cores,
# with programs that were kept and that were compiled: on LDPE, a polyisoprene melt, a gel, blood,
# two-mode PTT and noise.
_CURVES, _BANDS = _Part(2.0, 0.1), _Part(70.0, 0.1, 1.2, 0.43)
# A fit of the second search, whose constants differ from mode to mode, over one of the first
_BY_MODE = 2.0
# What is weighed after it, which is only done where it is the likelier, over that after the first
_WEIGHED_TOO = 0.6
# Share of what follows a search where no effect is the likeliest: few hypotheses are near
_FEW_NEAR = 0.2
# Least share of the time that fits are taken to have had, the rest being seconds besides
_SLOW = 0.3


class SearchTime:
    """Seconds left of searches one after another, by their lines.

    `most`: largest number of effects. `several_modes`: whether a search with constants that differ
    from mode to mode may follow; it does if the likeliest effects have such. `rounds`: how often
    all of it is done, each time with another run left out. `held_out`: whether runs are held out.
    `curves`: whether curves of one variable are tried. `reported`: whether these, bands and the
    next test belong to it. `clock`: seconds now. `crowding`: how much longer this process takes
    than alone. `compiled`: share of programs that have to be compiled.
    """

    def __init__(
        self,
        most: int,
        several_modes: bool,
        rounds: int = 1,
        held_out: bool = True,
        curves: bool = True,
        reported: bool = True,
        clock: Callable[[], float] = time.perf_counter,
        crowding: Callable[[], float] | None = None,
        compiled: Callable[[], float] = compiled_share,
    ):
        self.crowding, self.clock, self.compiled = crowding or Crowding(), clock, compiled
        self._most, self._several_modes, self._rounds = most, several_modes, rounds
        self._weighing = _WEIGHED if held_out else _WEIGHED_ALONE
        self._reporting = [_CURVES, _BANDS][not curves :] if reported else []
        self._begun: float | None = None
        self._follows, self._near = several_modes, 1.0  # whether another search; few near: less
        self._done = self._seconds = 0.0  # fits, and seconds besides
        self._before, self._round_before = 0.0, (0.0, 0.0)  # those before this search, this round
        self._searches, self._each = 0, 1.0  # of this round, and a fit of it over one of the first
        self._depth = self._size = self._weigh = 0.0  # of this search; fits that weigh it
        self._to_come = self._fitted = 0.0  # fits of this search, and hypotheses so far
        self._exchanged: float | None = None
        self._reports: list[_Part] = []  # to come after it
        self._in_last = False  # whether only the last of these is

    def heard(self, line: str) -> float | None:
        """Return the seconds left after a line of the search; None before anything was fitted."""
        if likeliest := re.search(r"likeliest: (.*)", line):
            known = {**built_in_effects(), **named_effects()}
            names = (one for one in likeliest[1].split(", ") if one in known)
            differ = any(may_differ_by_mode(known[one]) for one in names)
            self._follows = self._several_modes and differ
            self._near = _FEW_NEAR if likeliest[1] == "none" else 1.0
        if found := re.search(r"search among (\d+)", line):
            self._search(float(found[1]))
        elif found := re.search(r"sets of (\d+): (\d+) fitted", line):
            self._depth, fitted = map(float, found.groups())
            self._fitted += fitted
            self._done += self._each * fitted * (1.0 if self._depth > 1 else _FIRST)
            exchanged = self._exchanged if self._near == 1.0 else 0.0
            self._expect(self._deeper * (self._most - self._depth) + (exchanged or 0.0))
        elif found := re.search(r"exchanged: (\d+)", line):
            self._exchanged = _EXCHANGE * max(float(found[1]) - self._fitted, 0.0)
            self._done += self._each * self._exchanged
            self._most = self._depth  # the next one goes as far
            self._expect(0.0)
        elif "from mode to mode" in line or "curves of" in line:
            self._done += self._to_come + self._weigh
            self._to_come = self._weigh = 0.0
            self._follows = "curves of" not in line
        elif "bands" in line and self._reports:
            self._pass(self._reports[:-1])
            self._reports, self._in_last = self._reports[-1:], True
        if self._begun is None or not self._done:
            return None
        fits = self._to_come + self._weigh
        if self._follows and self._searches < 2:
            # which fits nothing again but what may differ by mode
            fits += _BY_MODE * (self._deeper * max(self._most - 1, 0) + (self._exchanged or 0.0))
            fits += _WEIGHED_TOO * self._of(self._weighing)
        fits += sum(map(self._of, self._reports))
        seconds = self._besides(self._reports)
        fits += (self._rounds - 1) * (self._done - self._round_before[0] + fits)
        seconds += (self._rounds - 1) * (self._seconds - self._round_before[1] + seconds)
        passed, crowding = self.clock() - self._begun, self.crowding()
        of_fits = max(passed - crowding * self._seconds, _SLOW * passed)
        return of_fits / self._done * fits + crowding * seconds

    def _search(self, candidates: float) -> None:
        """Begin a search, or a round."""
        self._begun = self.clock() if self._begun is None else self._begun
        if self._in_last:
            self._pass(self._reports)
            self._rounds, self._searches, self._in_last = self._rounds - 1, 0, False
            self._round_before = self._done, self._seconds
        self._searches, self._before, self._fitted = self._searches + 1, self._done, 0.0
        if self._exchanged is None:
            self._exchanged = min(_EXCHANGED, _EACH * candidates)
        self._deeper = min(_DEEPER, _EACH * candidates)
        self._reports = self._reporting
        self._each = 1.0 if self._searches < 2 else _BY_MODE
        first = _FIRST * candidates if self._searches < 2 else 0.0
        self._expect(first + self._deeper * max(self._most - 1, 0) + self._exchanged)

    def _expect(self, fits: float) -> None:
        """Set what is to come of this search, so many fits and what weighs them."""
        self._to_come = self._each * fits
        self._size = self._done - self._before + self._to_come
        self._weigh = self._of(self._weighing) * (1.0 if self._searches < 2 else _WEIGHED_TOO)

    def _of(self, part: _Part) -> float:
        return self._near * min(part.fits, part.share * self._size)

    def _pass(self, parts: list[_Part]) -> None:
        self._done += sum(map(self._of, parts))
        self._seconds += self._besides(parts)

    def _besides(self, parts: list[_Part]) -> float:
        compiled = self.compiled()
        return self._near * sum(part.seconds + compiled * part.compiling for part in parts)


# Seconds in which learners learn, and in which laws are weighed: a constant, and what compiling
# adds, which a crowded machine prolongs, and a share of the search's. Measured on the demonstration
# and on LDPE, at first and second starts.
_LEARN, _WEIGH = (0.1, 11.0, 1.1), (0.7, 1.6, 0.2)
_SLOWER = 2.0  # Factor by which learning may change what is expected of weighing
_LEAST = 0.15  # Share of a part's expected time that is still told of it once that time is over


class ComparisonTime:
    """Progress of a comparison; `searches`: time of its search."""

    def __init__(self, progress: Progress, searches: SearchTime):
        self._searches, self._clock = searches, searches.clock
        self._tell = by_time(progress, self._clock)
        self._begun = self._since = self._clock()
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
        crowding, compiled = self._searches.crowding(), self._searches.compiled()
        self._learn, self._weigh = (
            (kept + compiled * compiling) * crowding + share * self._search
            for kept, compiling, share in (_LEARN, _WEIGH)
        )
