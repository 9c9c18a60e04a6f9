"""Steps whose widths each vector chooses for itself, where the rate is a straight line in time.

A step is taken whole and in two halves. Where these agree the vector goes on from the halves,
extrapolated, and else takes a shorter step   [step doubling with local extrapolation: Hairer,
Nørsett & Wanner 1993, Solving Ordinary Differential Equations I, section II.4]. What a vector
chooses depends on no other beside it.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import llvmlite.ir as ir

from discover.programs.lanes import Arithmetic, Writing
from discover.programs.lanes.arithmetic import INTEGER

# By how much halves and whole may differ, of the stress of a mode. States of the fluid are of
# second order where the modes are of fourth, and may differ by more
import os
TOLERANCE = float(os.environ.get('TOL','1e-6'))
_OF_STATES = float(os.environ.get('OS','1e-2'))

# A stress over its modulus, and a structure variable, below which less than the tolerance counts
_SMALL = 1e-3

# By how much a step is longer or shorter than the one before
_SURE, _LONGEST, _SHORTEST, _ORDER = 0.9, 3e-4, 0.2, 5.0

# By how much a state may still change until the end of an interval of constant rate, where it is
# taken to be steady
_STEADY = 1e-10

# How far a rate may be from the straight line, of itself
_STRAIGHT = 1e-9

_EIGHT_BITS = ir.IntType(8)
_ENOUGH = 10**9


class OwnWidths:
    """Writes what stands around a step, which is written once.

    Parameters
    ----------
    w, arithmetic
        Where it is written.
    elapsed, width, off, moved
        Places in the scratch array: of the time since such steps began, of the width that comes
        next, and of what was wrong with the last and how far it went.
    state
        Where the state begins that a step changes.
    levels, modes
        Where in it states of the fluid stand, and the modes.
    variables
        Structure variables of each mode.
    has_states
        Whether any of the vectors has states of the fluid.
    """

    def __init__(
        self,
        w: Writing,
        arithmetic: Arithmetic,
        elapsed: int,
        width: int,
        off: int,
        moved: int,
        state: int,
        levels: range,
        modes: int,
        variables: int,
        has_states: Any,
    ):
        self._w, self._arithmetic = w, arithmetic
        self._straight = w.builder.alloca(INTEGER)
        self._elapsed, self._width, self._state = elapsed, width, state
        self._off_at, self._moved_at = off, moved
        self._levels, self._modes, self._variables = levels, modes, variables
        self._numbers = 4 + variables
        size = w.at((w.counts["modes"], self._numbers), (modes - state, 1))
        self._size = size
        # of an error of fifth order the halves have a fifteenth of what they differ by, of one of
        # third order a third
        self._further = arithmetic.chosen(has_states, 1.0 / 3.0, 1.0 / 15.0)

    def _kept(self, place: Any) -> Any:
        return self._w.load("scratch", place)

    def _keep(self, value: Any, place: Any) -> None:
        self._w.store(self._arithmetic.lanes(value), "scratch", place)

    def _any(self, truths: Any) -> Any:
        bits = self._w.builder.bitcast(truths, _EIGHT_BITS)
        return self._w.builder.icmp_unsigned("!=", bits, _EIGHT_BITS(0))

    def steps(self, run: Any, number: Any, half: Any) -> tuple[Any, Any]:
        """Return how many steps of the grid are one interval, and whether they are several.

        One where the rate of any vector is no straight line over all of them: an instrument may
        shape what was commanded.
        """
        w, b, a = self._w, self._w.builder, self._arithmetic
        place = w.at((run, w.counts["steps"]), (number, 1))
        several = w.load("held", place)
        first, whole = w.load("rate", half), a.splat(w.load("whole", place))
        slope = a.divide(a.subtract(w.load("rate", w.at((half, 1), (several, 2))), first), whole)
        most = a.multiply(_STRAIGHT, a.add(a.size(first), a.multiply(a.size(slope), whole)))
        straight = self._straight
        b.store(INTEGER(1), straight)
        self._keep(0.0, self._elapsed)
        is_several = b.icmp_signed(">", several, INTEGER(1))
        count = b.select(is_several, several, INTEGER(0))
        with w.loop(count, lambda: self._is_straight()) as more, a.apart():
            width = a.splat(w.load("width", w.at((place, 1), (more, 1))))
            begin = self._kept(self._elapsed)
            for i, share in ((1, 0.5), (2, 1.0)):
                line = a.add(first, a.multiply(slope, a.add(begin, a.multiply(share, width))))
                rate = w.load("rate", w.at((half, 1), (more, 2), (i, 1)))
                off = a.compare(">", a.size(a.subtract(rate, line)), most, of_nothing=True)
                with b.if_then(self._any(off)):
                    b.store(INTEGER(0), straight)
            self._keep(a.add(begin, width), self._elapsed)
        is_several = b.and_(is_several, self._is_straight())
        return b.select(is_several, several, INTEGER(1)), is_several

    def _is_straight(self) -> Any:
        return self._w.builder.icmp_signed("!=", self._w.builder.load(self._straight), INTEGER(0))

    @contextmanager
    def parts(
        self, run: Any, number: Any, is_held: Any, rates: Sequence[Any], last: Any
    ) -> Iterator[tuple[Any, Any, tuple[Any, ...]]]:
        """Write a step again and again until each vector has come to the end of an interval.

        Yields the time in it, the width, and the rates at its beginning, in its middle and at its
        end.
        """
        w, b, a = self._w, self._w.builder, self._arithmetic
        place = w.at((run, w.counts["steps"]), (number, 1))
        width = w.load("width", place)
        whole = a.splat(b.select(is_held, w.load("whole", place), width))
        least = a.splat(w.load("least", place))
        slope = a.divide(a.subtract(last, rates[0]), whole)
        self._keep(0.0, self._elapsed)
        # after a step of the grid the rate may have changed
        self._keep(a.chosen(is_held, a.larger(self._kept(self._width), least), 0.0), self._width)

        def is_left():
            return self._any(a.builder.fcmp_ordered("<", self._kept(self._elapsed), whole))

        with w.loop(b.select(is_held, INTEGER(_ENOUGH), INTEGER(1)), is_left), a.apart():
            elapsed, width = self._kept(self._elapsed), self._kept(self._width)
            left = a.subtract(whole, elapsed)
            # two of one length rather than one and what it leaves
            inside = a.smaller(width, a.multiply(0.5, left))
            chosen = a.chosen(a.compare("<=", left, width), left, inside)
            own = a.chosen(is_held, chosen, whole)
            with b.if_then(is_held), a.apart():
                self._copy(0, 1)
            with w.loop(b.select(is_held, INTEGER(3), INTEGER(1))) as part, a.apart():
                with b.if_then(b.icmp_signed("==", part, INTEGER(1))), a.apart():
                    self._copy(0, 2)
                    self._copy(1, 0)
                is_half = b.icmp_signed(">", part, INTEGER(0))
                step = a.chosen(is_half, a.multiply(0.5, own), own)
                is_second = b.icmp_signed("==", part, INTEGER(2))
                begin = a.chosen(is_second, a.add(elapsed, step), elapsed)
                felt = tuple(
                    a.chosen(
                        is_held,
                        a.add(
                            rates[0],
                            a.multiply(slope, a.add(begin, a.multiply(share, step))),
                        ),
                        rate,
                    )
                    for share, rate in zip((0.0, 0.5, 1.0), rates, strict=True)
                )
                yield begin, step, felt
            with b.if_then(is_held), a.apart():
                self._judge(whole, least, left, own, slope)

    def _copy(self, source: int, target: int) -> None:
        w = self._w
        with w.loop(self._size) as number:
            at = w.at((number, 1), (self._state, 1))
            value = self._kept(w.at((at, 1), (self._size, source)))
            self._keep(value, w.at((at, 1), (self._size, target)))

    def _judge(self, whole: Any, least: Any, left: Any, width: Any, slope: Any) -> None:
        """Write which vectors take the step, and how long the next one is."""
        w, a = self._w, self._arithmetic
        off, moved = self._differences()
        taken = a.compare("<=", off, 1.0)
        # not shorter than what the grid would take, and what is no number needs no care
        taken = a.both("or", taken, a.compare("<=", width, least, of_nothing=True))
        taken = a.both("or", taken, a.compare("!=", off, off, of_nothing=True))
        with w.loop(self._size) as number, a.apart():
            at = w.at((number, 1), (self._state, 1))
            before, once = (self._kept(w.at((at, 1), (self._size, i))) for i in (1, 2))
            twice = self._kept(at)
            better = a.add(twice, a.multiply(self._further, a.subtract(twice, once)))
            self._keep(a.chosen(taken, better, before), at)
        elapsed = self._kept(self._elapsed)
        ahead = a.divide(a.multiply(moved, left), width)
        steady = a.both("and", a.compare("==", slope, 0.0), a.compare("<=", ahead, _STEADY))
        steady = a.both("or", steady, a.compare(">=", width, left))
        arrived = a.chosen(steady, whole, a.add(elapsed, width))
        self._keep(a.chosen(taken, arrived, elapsed), self._elapsed)
        factor = a.multiply(_SURE, a.power(a.add(off, _LONGEST), -1.0 / _ORDER))
        following = a.larger(a.multiply(width, a.larger(factor, _SHORTEST)), least)
        known = self._kept(self._width)
        # what ended early at the end of an interval says nothing against a longer one
        ended = a.both("and", taken, a.compare("<", width, known))
        following = a.chosen(ended, a.larger(known, following), following)
        self._keep(a.chosen(a.compare(">", width, 0.0), following, known), self._width)

    def _differences(self) -> tuple[Any, Any]:
        """Return how far halves and whole are apart, over what they may be, and how far both went."""
        w, a = self._w, self._arithmetic
        size, places = self._size, (self._off_at, self._moved_at)
        for place in places:
            self._keep(0.0, place)

        def seen(at: Any, scale: Any, share: float) -> None:
            twice, before, once = (self._kept(w.at((at, 1), (size, i))) for i in range(3))
            scale = a.add(a.size(twice), scale)
            for place, other, part in zip(places, (once, before), (share, 1.0), strict=True):
                apart = a.divide(a.multiply(part, a.size(a.subtract(twice, other))), scale)
                self._keep(a.larger(self._kept(place), apart), place)

        for place in self._levels:
            seen(place, 1e-2, _OF_STATES / TOLERANCE)
        with w.loop(w.counts["modes"]) as mode, a.apart():
            at = w.at((mode, self._numbers), (self._modes, 1))
            sheared = a.add(a.size(self._kept(w.at((at, 1), (3, 1)))), _SMALL)
            for i in range(self._numbers):
                seen(w.at((at, 1), (i, 1)), sheared if i < 4 else 1.0, 1.0 / TOLERANCE)
        return self._kept(self._off_at), self._kept(self._moved_at)
