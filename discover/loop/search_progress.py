"""How much of searches is done, by their lines, and of a comparison around one.

A part is a share of the time and not seconds, of which another machine, or a busy one, takes more.
Shares were measured on two cores on LDPE, a polyisoprene melt, a gel, blood and two-mode PTT: they
tell about a half to twice of the time that is left.
"""

import re

from discover.effects.registry import built_in_effects, named_effects
from discover.forward.declared import may_differ_by_mode
from discover.progress import Progress, rising

# Shares that are done when a line is said; of sets of effects when the largest are fitted
_ONE = {
    "search among": 0.08, "sets of": 0.36, "exchanged": 0.56, "curves of": 0.72, "bands": 0.8,
}  # fmt: skip
_FIRST = {
    "search among": 0.03, "sets of": 0.13, "exchanged": 0.17, "from mode to mode": 0.33,
    "curves of": 0.77, "bands": 0.88,
}  # fmt: skip
_SECOND = _FIRST | {"search among": 0.36, "sets of": 0.46, "exchanged": 0.51}


class SearchProgress:
    """Share of searches one after another that is done.

    `most`: largest number of effects. `several_modes`: whether a search with constants that differ
    from mode to mode may follow. `rounds`: how often all of it is done, each time with another run
    left out.
    """

    def __init__(self, most: int, several_modes: bool, rounds: int = 1):
        self._most, self._rounds, self._round = max(most, 1), rounds, -1
        self._own = _FIRST if several_modes else _ONE  # shares of a first search
        self._parts, self._done, self._chooses = self._own, 0.0, False

    def heard(self, line: str) -> float:
        """Return the share that is done at a line; that of a choice among laws is not known."""
        begins = "law 1 of" in line
        self._chooses |= begins
        if "search among" in line:
            if self._done == _FIRST["from mode to mode"]:
                self._parts = _SECOND
            else:
                begins, self._chooses = not self._chooses, False
        if begins:
            self._round, self._parts, self._done = self._round + 1, self._own, 0.0
        if self._round < 0 or self._chooses:
            return max(self._round, 0) / self._rounds
        names = re.search(r"likeliest: (.*)", line)
        if names and self._own is _FIRST and self._parts is not _SECOND:
            # another search follows where the likeliest effects have constants that may differ
            known = {**built_in_effects(), **named_effects()}
            found = (known[name] for name in names[1].split(", ") if name in known)
            self._parts = _FIRST if any(map(may_differ_by_mode, found)) else _ONE
        for said, share in self._parts.items():
            if said in line:
                self._done = share
        if depth := re.search(r"sets of (\d+)", line):
            begun, last = self._parts["search among"], self._parts["sets of"]
            self._done = begun + (last - begun) * min(float(depth[1]) / self._most, 1.0)
        return (self._round + self._done) / self._rounds


# Shares that are done when a comparison begins its search, its learners, and to weigh their laws:
# between those of the demonstration, with programs that were kept and compiled, and of LDPE
_SEARCH, _LEARN, _WEIGH = 0.05, 0.37, 0.68


class ComparisonProgress:
    """Progress of a comparison; `most`, `several_modes` as of `SearchProgress`."""

    def __init__(self, progress: Progress, most: int, several_modes: bool):
        self._tell, self._searches = rising(progress), SearchProgress(most, several_modes)

    def searching(self, line: str) -> None:
        """Pass on a line of the search, or of one after the learners."""
        self._tell(line, _SEARCH + (_LEARN - _SEARCH) * self._searches.heard(line))

    def learned(self, text: str, fraction: float) -> None:
        """Pass on what learners say."""
        self._tell(text, _LEARN + (_WEIGH - _LEARN) * fraction)

    def weighing(self, text: str) -> None:
        """Begin to weigh."""
        self._tell(text, _WEIGH)
