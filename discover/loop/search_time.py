"""Time that searches still take, told from the hypotheses fitted so far."""

import re
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from discover.effects.registry import built_in_effects, named_effects
from discover.forward.declared import may_differ_by_mode
from discover.progress import Crowding

Amount = Float[np.ndarray, "2"]
"""Part of a search: fits of one hypothesis, and seconds besides."""


class _Part(NamedTuple):
    """What follows a search; `share`: most of its fits over those of the search."""

    fits: float
    seconds: float = 0.0
    share: float = 1.0


_DEEPER, _EXCHANGED = 24.0, 70.0
"""Fits of each further effect, and of exchanged effects: at most so many."""

_DEEPER_EACH, _EXCHANGED_EACH = 2.0, 2.0
"""Most of both for one candidate."""

_FIRST = 0.8
"""Fit of one effect over one of several: more of them are given up at once."""

_EXCHANGE = 1.4
"""Fits that an exchanged hypothesis takes."""

_WEIGHED, _WEIGHED_ALONE = _Part(135.0, share=1.2), _Part(10.0)
"""What is weighed after the search: with runs held out, when all are fitted again, or without."""

_CURVES, _BANDS = _Part(36.0, 3.5, 0.5), _Part(15.0, 8.0, 0.7)
"""Curves of one variable; bands, intervals and the next test. All these were measured on two cores:
on LDPE, a polyisoprene melt, a gel, blood, two-mode PTT and noise."""

_SECOND = 1.6
"""What is weighed after the second search, with more constants, over that after the first."""

_FEW_NEAR = 0.2
"""Share of what follows a search where no effect is the likeliest: few hypotheses are near."""

_SLOW = 0.3
"""Least share of the time that fits are taken to have had, the rest being seconds besides."""


def _may_differ(names: str) -> bool:
    """Return whether one of several effects has constants that may differ from mode to mode."""
    known = {**built_in_effects(), **named_effects()}
    return any(may_differ_by_mode(known[one]) for one in names.split(", ") if one in known)


def _fits(number: float) -> Amount:
    return np.array([number, 0.0])


class SearchTime:
    """Seconds left of searches one after another, by their lines.

    `most`: largest number of effects. `several_modes`: whether a search with constants that differ
    from mode to mode may follow; it does if the likeliest effects have such. `rounds`: how often
    all of it is done, each time with another run left out. `held_out`: whether runs are held out.
    `curves`: whether curves of one variable are tried. `reported`: whether these, bands and the
    next test belong to it. `clock`: seconds now. `crowding`: how much longer this process takes
    than alone.
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
    ):
        self._crowding = crowding or Crowding()
        self._most, self._several_modes, self._clock = most, several_modes, clock
        self._rounds, self._reported = rounds, reported
        self._weighed = _WEIGHED if held_out else _WEIGHED_ALONE
        self._curves = _CURVES if curves else _Part(0.0)
        self._begun: float | None = None
        self._searches = 0  # of this round
        self._follows = several_modes  # whether another one does
        self._near = 1.0  # what follows a search, over what was measured
        self._done = self._before = _fits(0.0)  # all, and before this search
        self._rest = self._after = _fits(0.0)  # of this search, and of what is reported after it
        self._fitted, self._exchanged = 0.0, -1.0  # hypotheses of this search
        self._depth, self._deeper, self._size = 0, _DEEPER, 0.0
        self._first = self._round_before = _fits(0.0)
        self._reports = False

    def heard(self, line: str) -> float | None:
        """Return the seconds left after a line of the search; None before anything was fitted."""
        if likeliest := re.search(r"likeliest: (.*)", line):
            self._follows = self._several_modes and _may_differ(likeliest[1])
            self._near = _FEW_NEAR if likeliest[1] == "none" else 1.0
        if found := re.search(r"search among (\d+)", line):
            self._search(float(found[1]))
        elif found := re.search(r"sets of (\d+): (\d+) fitted", line):
            self._depth = int(found[1])
            self._spend(_fits(float(found[2]) * (1.0 if self._depth > 1 else _FIRST)))
            self._fitted += float(found[2])
            exchanged = self._exchanged if self._near == 1.0 else 0.0
            self._expect(self._deeper * (self._most - self._depth) + exchanged)
        elif found := re.search(r"exchanged: (\d+)", line):
            exchanged = _EXCHANGE * max(float(found[1]) - self._fitted, 0.0)
            self._spend(_fits(exchanged))
            self._expect(0.0)
            # the next one goes as far
            self._most, self._exchanged = self._depth, exchanged
        elif "from mode to mode" in line:
            self._spend(self._rest)
            self._first, self._follows = self._done - self._before, True
        elif "curves of" in line:
            self._spend(self._rest)
            self._searches = 2  # there is no other one
        elif "bands" in line and self._after.any():
            self._done = self._done + self._of(self._curves)
            self._after = self._of(_BANDS)
            self._reports = True
        if self._begun is None or not self._done[0]:
            return None
        left = self._rest + self._after
        if self._follows and self._searches < 2:
            left = left + (self._first if self._first.any() else self._this_search)
        left = left + (self._rounds - 1) * (self._done - self._round_before + left)
        passed = self._clock() - self._begun
        besides = self._crowding() * np.array([self._done[1], left[1]])
        one_fit = max(passed - besides[0], _SLOW * passed) / self._done[0]
        return float(one_fit * left[0] + besides[1])

    @property
    def _this_search(self) -> Amount:
        return self._done - self._before + self._rest

    def _search(self, candidates: float) -> None:
        """Begin a search, or a round."""
        self._begun = self._clock() if self._begun is None else self._begun
        if self._reports:
            self._done, self._reports = self._done + self._after, False
            self._rounds, self._searches, self._round_before = self._rounds - 1, 0, self._done
        self._searches, self._before, self._fitted = self._searches + 1, self._done, 0.0
        if self._exchanged < 0.0:
            self._exchanged = min(_EXCHANGED, _EXCHANGED_EACH * candidates)
        self._deeper = min(_DEEPER, _DEEPER_EACH * candidates)
        first = _FIRST * candidates
        self._expect(first + self._deeper * max(self._most - 1, 0) + self._exchanged)

    def _expect(self, fits: float) -> None:
        """Set what is to come of this search, so many fits and what follows them."""
        self._size = float((self._done - self._before)[0]) + fits
        weighed = self._of(self._weighed)
        self._rest = _fits(fits) + (weighed if self._searches < 2 else _SECOND * weighed)
        nothing = _fits(0.0)
        self._after = self._of(self._curves) + self._of(_BANDS) if self._reported else nothing

    def _of(self, part: _Part) -> Amount:
        return self._near * np.array([min(part.fits, part.share * self._size), part.seconds])

    def _spend(self, part: Amount) -> None:
        self._done, self._rest = self._done + part, _fits(0.0)
