"""Steps whose widths each vector chooses for itself, where the rate is a straight line in time.

A step is taken whole and in two halves. Where these agree the vector goes on from the halves,
extrapolated, and else takes a shorter step   [step doubling with local extrapolation: Hairer,
Nørsett & Wanner 1993, Solving Ordinary Differential Equations I, section II.4].
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from discover.programs.lanes.arithmetic import INTEGER

if TYPE_CHECKING:
    from discover.forward.side_by_side.code import Code

# By how much halves and whole may differ, of the stress of a mode. States of the fluid are of
# second order where the modes are of fourth, and may differ by more
_TOLERANCE = 1e-6
_OF_STATES = 1e-2

# A stress over its modulus, and a state of the fluid, below which less than the tolerance counts
_SMALL, _SMALL_STATE = 1e-3, 1e-2

# By how much a step is longer or shorter than the one before
_SURE, _LONGEST, _SHORTEST, _ORDER = 0.9, 3e-4, 0.2, 5.0

# Of what is left of an interval, the longest step that is taken however much its halves differ
_OF_THE_REST = 0.1

# Of an interval, the time within which its end is reached
_ROUNDING = 1e-13

# By how much a state may still change until the end of an interval of constant rate, where it is
# taken to be steady
_STEADY = 1e-10

# The same of what is nearly steady, the share of a step by which its halves then differ at the
# limit of stability, and how much shorter the next one is there
_NEARLY, _AWAY, _SHORTER = 1e-2, 0.1, 0.7

# How far a rate may be from the straight line, of itself
_STRAIGHT = 1e-9

OWN = ("elapsed", "width", "own", "slope", "off", "moved")
"""Of an interval the time that has passed, and the width that comes next; of a step its width; the
slope of the rate; by how much halves and whole differ, and how far both went."""

_ENOUGH = 10**9


class OwnWidths:
    """Writes what stands around a step, which is written once.

    `at`: places in the scratch array of what is `OWN`. `state`, `levels`, `modes`: where what a
    step changes begins, and in it states of the fluid and modes.
    """

    def __init__(
        self,
        code: "Code",
        at: Sequence[int],
        state: int,
        levels: range,
        modes: int,
        has_states: Any,
    ):
        self._w, self._arithmetic = w, arithmetic = code._w, code._arithmetic
        self._keep, self._kept = code._keep, code._kept
        self._straight, self._left = (w.builder.alloca(INTEGER) for _ in range(2))
        self._at = dict(zip(OWN, at, strict=True))
        self._state, self._levels, self._modes = state, levels, modes
        self._numbers = code.size
        self._size = w.at((w.counts["modes"], self._numbers), (modes - state, 1))
        # of an error of fifth order the halves have a fifteenth of what they differ by, of one of
        # third order a third
        self._further = arithmetic.chosen(has_states, 1.0 / 3.0, 1.0 / 15.0)

    def steps(self, run: Any, number: Any, half: Any) -> tuple[Any, Any]:
        """Return how many steps of the grid are one interval, and whether widths in it are chosen.

        They are where every vector's rate is a straight line: an instrument may shape what was
        commanded.
        """
        w, b, a = self._w, self._w.builder, self._arithmetic
        place = w.at((run, w.counts["steps"]), (number, 1))
        several = w.load("held", place)
        b.store(INTEGER(0), self._straight)
        with b.if_then(b.icmp_signed(">", several, INTEGER(1))), a.apart():
            first, whole = w.load("rate", half), a.splat(w.load("whole", place))
            change = a.subtract(w.load("rate", w.at((half, 1), (several, 2))), first)
            slope = a.divide(change, whole)
            most = a.multiply(_STRAIGHT, a.add(a.size(first), a.size(change)))
            b.store(INTEGER(1), self._straight)
            self._keep(slope, self._at["slope"])
            self._keep(0.0, self._at["elapsed"])
            with w.loop(several, self._is_straight) as more, a.apart():
                width = a.splat(w.load("width", w.at((place, 1), (more, 1))))
                begin = self._kept(self._at["elapsed"])
                for i, share in ((1, 0.5), (2, 1.0)):
                    line = a.add(first, a.multiply(slope, a.add(begin, a.multiply(share, width))))
                    rate = w.load("rate", w.at((half, 1), (more, 2), (i, 1)))
                    off = a.compare(">", a.size(a.subtract(rate, line)), most, of_nothing=True)
                    with b.if_then(self._arithmetic.in_some(off)):
                        b.store(INTEGER(0), self._straight)
                self._keep(a.add(begin, width), self._at["elapsed"])
        return b.select(self._is_straight(), several, INTEGER(1)), self._is_straight()

    def _is_straight(self) -> Any:
        return self._w.builder.icmp_signed("!=", self._w.builder.load(self._straight), INTEGER(0))

    @contextmanager
    def parts(
        self, run: Any, number: Any, is_own: Any, rates: Sequence[Any]
    ) -> Iterator[tuple[Any, Any, tuple[Any, ...]]]:
        """Write a step until each vector has come to the end; yields time, width and rates."""
        w, b, a = self._w, self._w.builder, self._arithmetic
        place, at = w.at((run, w.counts["steps"]), (number, 1)), self._at
        width, whole, least = (a.splat(w.load(n, place)) for n in ("width", "whole", "least"))
        self._keep(0.0, at["elapsed"])
        self._keep(width, at["own"])
        # after a step of the grid the rate may have changed
        known = a.chosen(is_own, a.larger(self._kept(at["width"]), least), 0.0)
        self._keep(known, at["width"])
        b.store(INTEGER(1), self._left)

        def is_left():
            return b.icmp_signed("!=", b.load(self._left), INTEGER(0))

        with w.loop(b.select(is_own, INTEGER(_ENOUGH), INTEGER(1)), is_left), a.apart():
            with b.if_then(is_own), a.apart():
                self._choose(whole)
                self._copy(0, 1)
            elapsed, own = self._kept(at["elapsed"]), self._kept(at["own"])
            with w.loop(b.select(is_own, INTEGER(3), INTEGER(1))) as part, a.apart():
                with b.if_then(b.icmp_signed("==", part, INTEGER(1))), a.apart():
                    self._copy(0, 2)
                    self._copy(1, 0)
                is_half = b.icmp_signed(">", part, INTEGER(0))
                step = a.chosen(is_half, a.multiply(0.5, own), own)
                is_second = b.icmp_signed("==", part, INTEGER(2))
                begin = a.chosen(is_second, a.add(elapsed, step), elapsed)
                slope, felt = self._kept(at["slope"]), []
                for share, rate in zip((0.0, 0.5, 1.0), rates, strict=True):
                    then = a.add(begin, a.multiply(share, step))
                    felt.append(a.chosen(is_own, a.add(rates[0], a.multiply(slope, then)), rate))
                yield begin, step, tuple(felt)
            with b.if_then(is_own), a.apart():
                self._judge(whole, least)

    def _choose(self, whole: Any) -> None:
        """Write how long the next step is."""
        a = self._arithmetic
        left = a.subtract(whole, self._kept(self._at["elapsed"]))
        width = self._kept(self._at["width"])
        # two of one length rather than one and what it leaves
        inside = a.smaller(width, a.multiply(0.5, left))
        self._keep(a.chosen(a.compare("<=", left, width), left, inside), self._at["own"])

    def _copy(self, source: int, target: int) -> None:
        w = self._w
        with w.loop(self._size) as number:
            at = w.at((number, 1), (self._state, 1))
            value = self._kept(w.at((at, 1), (self._size, source)))
            self._keep(value, w.at((at, 1), (self._size, target)))

    def _judge(self, whole: Any, least: Any) -> None:
        """Write which vectors take the step, and how long the next one is."""
        w, b, a, at = self._w, self._w.builder, self._arithmetic, self._at
        off, moved = self._differences()
        elapsed, width, known = (self._kept(at[name]) for name in ("elapsed", "own", "width"))
        left = a.subtract(whole, elapsed)
        # towards the end of an interval the tolerance alone counts
        least = a.smaller(least, a.multiply(_OF_THE_REST, left))
        taken = a.compare("<=", width, least, of_nothing=True)
        taken = a.both("or", taken, a.compare("<=", off, 1.0))
        with w.loop(self._size) as number, a.apart():
            place = w.at((number, 1), (self._state, 1))
            before, once = (self._kept(w.at((place, 1), (self._size, i))) for i in (1, 2))
            twice = self._kept(place)
            better = a.add(twice, a.multiply(self._further, a.subtract(twice, once)))
            self._keep(a.chosen(taken, better, before), place)
        ahead = a.divide(a.multiply(moved, left), width)
        arrived = a.compare("==", self._kept(at["slope"]), 0.0)
        arrived = a.both("and", arrived, a.compare("<=", ahead, _STEADY))
        arrived = a.both("or", arrived, a.compare(">=", width, left))
        # a time that is left within rounding is never reached by parts of it
        arrived = a.both("or", arrived, a.compare("<=", left, a.multiply(_ROUNDING, whole)))
        elapsed = a.chosen(taken, a.chosen(arrived, whole, a.add(elapsed, width)), elapsed)
        self._keep(elapsed, at["elapsed"])
        factor = a.multiply(_SURE, a.power(a.add(off, _LONGEST), -1.0 / _ORDER))
        # what ran away goes on in steps of no width, and what a long step made of no number is
        # tried again
        factor = a.chosen(a.both("or", taken, a.compare("==", off, off)), factor, _SHORTEST)
        following = a.larger(a.multiply(width, a.larger(factor, _SHORTEST)), least)
        # near a steady state halves and whole come closer as it does, but for steps at the limit of
        # their stability, which keep away from it
        keeps = a.compare(">", a.multiply(_TOLERANCE, off), a.multiply(_AWAY, moved))
        keeps = a.both("and", keeps, a.compare("<", ahead, _NEARLY))
        shorter = a.smaller(following, a.multiply(_SHORTER, width))
        following = a.chosen(keeps, shorter, following)
        # what ended early at the end of an interval says nothing against a longer one
        ended = a.both("and", taken, a.compare("<", width, known))
        following = a.chosen(ended, a.larger(known, following), following)
        self._keep(a.chosen(a.compare(">", width, 0.0), following, known), at["width"])
        is_left = self._arithmetic.in_some(a.compare("<", elapsed, whole))
        b.store(b.zext(is_left, INTEGER), self._left)

    def _differences(self) -> tuple[Any, Any]:
        """Return by how much halves and whole differ, over what they may, and how far they went."""
        w, a = self._w, self._arithmetic
        size, places = self._size, (self._at["off"], self._at["moved"])
        for place in places:
            self._keep(0.0, place)

        def seen(at: Any, scale: Any, share: float) -> None:
            twice, before, once = (self._kept(w.at((at, 1), (size, i))) for i in range(3))
            scale = a.add(a.size(twice), scale)
            for place, other, part in zip(places, (once, before), (share, 1.0), strict=True):
                apart = a.divide(a.multiply(part, a.size(a.subtract(twice, other))), scale)
                self._keep(a.larger(self._kept(place), apart), place)

        for place in self._levels:
            seen(place, _SMALL_STATE, _OF_STATES / _TOLERANCE)
        with w.loop(w.counts["modes"]) as mode, a.apart():
            at = w.at((mode, self._numbers), (self._modes, 1))
            sheared = a.add(a.size(self._kept(w.at((at, 1), (3, 1)))), _SMALL)
            for i in range(self._numbers):
                seen(w.at((at, 1), (i, 1)), sheared if i < 4 else 1.0, 1.0 / _TOLERANCE)
        return tuple(self._kept(place) for place in places)
