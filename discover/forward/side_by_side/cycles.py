"""The state in which a run begins whose oscillation had gone on for ever, for lanes.

Solved for as in `steady_states.periodic_start`, by differences: a cycle is followed from the
approximation, and from each component of all modes and each state moved a little. All passes,
and the run itself, share the code of one step.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import jax.numpy as jnp
import numpy as np

from discover.forward.steady_states import (
    FROM_REST,
    MOST,
    TOLERANCE,
    Approximation,
    goes_on,
    next_approximation,
    relative_change,
)
from discover.programs.lanes.arithmetic import INTEGER

if TYPE_CHECKING:
    from discover.forward.side_by_side.code import Code

# What a pass is: the run up to the cycle, cycles from rest, those of Newton's steps, the one that
# begins with what was found, and the run from there on
_BEFORE, _REST, _NEWTON, _CLOSING, _RUN = range(5)

# By how much a number is moved, of one and its size. All modes are moved by as much, that of the
# largest: what couples them would else show in those that are moved less
_MOVED = 1e-7

_ENOUGH = 10**9
_ALIVE, _CHANGE, _SHIFT, _LARGEST, _PERIOD = range(5)


def improved(relaxation_time, period, alive, moved, way, end, tangents):
    """Return the next approximation of a mode, by how much it moved, and whether there is hope.

    `alive`, `moved`: whether it is looked for, and by how much states have moved since the last.
    `way`, `end`, `tangents`: the approximation in one row, where a cycle ends, and that by
    direction and component.
    """
    size = len(end)
    now = approximation(way, size)
    following, better = next_approximation(now, end[:, None], tangents[None], moved)
    change = relative_change(now, following, (relaxation_time / period)[None], TOLERANCE)
    change = jnp.where(better[0], change, jnp.inf)
    hopeful = goes_on(following, jnp.asarray(jnp.inf), MOST, TOLERANCE)
    flat = jnp.concatenate([jnp.ravel(part) for part in following])
    return jnp.where(alive > 0.0, flat, way), change, jnp.where(hopeful, 1.0, 0.0)


def improved_level(alive, level, end, slope):
    """Return the next approximation of a state of the fluid, and by how much it moved."""
    # one that stays where it is, as of an effect that is absent, may be anywhere
    stays = end == level
    following = level + jnp.where(stays, 0.0, (end - level) / jnp.where(stays, 1.0, 1.0 - slope))
    moved = jnp.abs(following - level)
    moved = jnp.where(moved < jnp.inf, moved, jnp.inf)  # where it is no number
    return jnp.where(alive > 0.0, following, level), moved


def approximation(way, size: int) -> Approximation:
    """Return the approximation to one mode of numbers that follow one another."""
    stress, best, rest = way[:size], way[size : 2 * size], way[2 * size :]
    return Approximation(
        stress[:, None], best[:, None], rest[:1], rest[1 : size + 1, None], rest[-2:-1], rest[-1]
    )


class Cycles:
    """Writes passes through a run: of one that begins with a periodic state first its cycle's.

    `levels`: numbers of each state of the fluid, and its rest. `levels_at`, `modes_at`, `first`:
    where in the scratch array these, the modes and free room stand.
    """

    def __init__(
        self,
        code: "Code",
        levels: Sequence[tuple[int, float]],
        levels_at: int,
        modes_at: int,
        first: Any,
        has_states: Any,
    ):
        self._code, self._levels, self._size = code, levels, (size := code.size)
        self._levels_at, self._modes_at = levels_at, modes_at
        self._count = sum(count for count, _ in levels)
        w = code._w
        self._w, self._a = w, code._arithmetic
        self._globals = first
        # of each number of a state: where it is taken to be, where it ends, and the slope of that
        self._of_levels = w.at((first, 1), (_PERIOD + 1, 1))
        self._of_modes = w.at((self._of_levels, 1), (3 * self._count, 1))
        self._way = 3 * size + 3
        self._stride = self._way + size + size**2
        self._stage, self._index, self._left = (w.builder.alloca(INTEGER) for _ in range(3))
        with_states = INTEGER(1 + size + len(levels))
        self._directions = w.builder.select(has_states, with_states, INTEGER(1 + size))

    @staticmethod
    def room(levels: int, modes: int, size: int) -> int:
        """Return how much of the scratch array is needed, for so many numbers of states."""
        return _PERIOD + 1 + 3 * levels + modes * (3 * size + 3 + size + size**2)

    @contextmanager
    def passes(
        self, start: Any, end: Any, last: Any, period: Any, settle: Callable[[], None]
    ) -> Iterator[tuple[Any, Any, Any]]:
        """Write what follows some steps again and again, up to a run's end.

        Yields the first step, the one behind the last, and whether they are the run's. `start` is
        negative where there is no cycle. `settle`: writes what follows from the modes and states at
        its start.
        """
        w, b = self._w, self._w.builder
        has_cycle = b.icmp_signed(">=", start, INTEGER(0))
        b.store(b.select(has_cycle, INTEGER(_BEFORE), INTEGER(_RUN)), self._stage)
        b.store(INTEGER(0), self._index)
        b.store(INTEGER(1), self._left)
        self._keep(period, _PERIOD)
        start = b.select(has_cycle, start, INTEGER(0))

        def is_left():
            return b.icmp_signed("!=", b.load(self._left), INTEGER(0))

        with w.loop(_ENOUGH, is_left), self._a.apart():
            for stage, begin in ((_REST, self._begin_rest), (_NEWTON, self._begin_newton)):
                with self._where(stage):
                    begin()
            with self._where(_CLOSING):
                self._begin_closing()
            is_before, is_run = self._is(_BEFORE), self._is(_RUN)
            with b.if_then(b.not_(b.or_(is_before, is_run))), self._a.apart():
                settle()
            first = b.select(is_before, INTEGER(0), start)
            behind = b.select(is_before, start, b.select(is_run, last, end))
            yield first, behind, b.or_(is_before, is_run)
            # a stage that ends sets the next one, which is told from it once
            stage = b.load(self._stage)
            ends = (
                lambda: self._go_on(_REST),
                self._end_rest,
                self._end_newton,
                lambda: self._go_on(_RUN),
                lambda: b.store(INTEGER(0), self._left),
            )
            for number, finish in enumerate(ends):
                with b.if_then(b.icmp_signed("==", stage, INTEGER(number))), self._a.apart():
                    finish()

    def _is(self, stage: int) -> Any:
        return self._w.builder.icmp_signed("==", self._w.builder.load(self._stage), INTEGER(stage))

    @contextmanager
    def _where(self, stage: int) -> Iterator[None]:
        with self._w.builder.if_then(self._is(stage)), self._a.apart():
            yield

    def _go_on(self, stage: int) -> None:
        self._w.builder.store(INTEGER(stage), self._stage)
        self._w.builder.store(INTEGER(0), self._index)

    def _keep(self, value: Any, place: int) -> None:
        self._code._keep(value, self._w.at((self._globals, 1), (place, 1)))

    def _kept(self, place: int) -> Any:
        return self._code._kept(self._w.at((self._globals, 1), (place, 1)))

    def _of_level(self, which: int, number: int) -> Any:
        return self._w.at((self._of_levels, 1), (which * self._count + number, 1))

    @contextmanager
    def _each_mode(self) -> Iterator[tuple[Any, Any, Any]]:
        """Write what is done for each mode; yields it, its state and its approximation's place."""
        w = self._w
        with w.loop(w.counts["modes"]) as number, self._a.apart():
            state = w.at((number, self._size), (self._modes_at, 1))
            yield number, state, w.at((self._of_modes, 1), (number, self._stride))

    def _begin_rest(self) -> None:
        b, code = self._w.builder, self._code
        is_first = b.icmp_signed("==", b.load(self._index), INTEGER(0))
        with b.if_then(is_first), self._a.apart():
            code._rest(self._levels, self._levels_at)
            with self._each_mode() as (_, state, _):
                code._keep(np.zeros(self._size), state)

    def _begin_newton(self) -> None:
        b, code = self._w.builder, self._code
        index, place = b.load(self._index), 0
        for effect, (count, _) in enumerate(self._levels):
            is_moved = b.icmp_signed("==", index, INTEGER(1 + self._size + effect))
            for _ in range(count):
                level = code._kept(self._of_level(0, place))
                code._keep(self._shifted(level, is_moved, level), self._levels_at + place)
                place += 1
        with b.if_then(b.icmp_signed("==", index, INTEGER(0))), self._a.apart():
            self._keep(0.0, _LARGEST)
            with self._each_mode() as (_, _, way):
                for value in code._kept(way, self._size):
                    larger = self._a.larger(self._kept(_LARGEST), self._a.size(value))
                    self._keep(larger, _LARGEST)
        with self._each_mode() as (_, state, way):
            for i in range(self._size):
                at = self._w.at((state, 1), (i, 1))
                is_moved = b.icmp_signed("==", index, INTEGER(1 + i))
                value = code._kept(self._w.at((way, 1), (i, 1)))
                code._keep(self._shifted(value, is_moved, self._kept(_LARGEST)), at)

    def _shifted(self, value: Any, is_moved: Any, of: Any) -> Any:
        a = self._a
        return a.add(value, a.chosen(is_moved, self._width(of), 0.0))

    def _width(self, value: Any) -> Any:
        return self._a.multiply(_MOVED, self._a.add(1.0, self._a.size(value)))

    def _begin_closing(self) -> None:
        a, code = self._a, self._code
        found = a.compare("<", self._kept(_CHANGE), TOLERANCE)
        for i in range(self._count):
            code._keep(code._kept(self._of_level(0, i)), self._levels_at + i)
        with self._each_mode() as (_, state, way):
            for i, value in enumerate(code._kept(way, self._size)):
                at = self._w.at((state, 1), (i, 1))
                code._keep(a.chosen(found, value, float("nan")), at)

    def _end_rest(self) -> None:
        w, b, code, size = self._w, self._w.builder, self._code, self._size
        following = w.at((b.load(self._index), 1), (1, 1))
        b.store(following, self._index)
        with b.if_then(b.icmp_signed(">=", following, INTEGER(FROM_REST))), self._a.apart():
            for i in range(self._count):
                code._keep(code._kept(self._levels_at + i), self._of_level(0, i))
            with self._each_mode() as (_, state, way):
                stress = list(code._kept(state, size))
                rest = [np.inf, *np.zeros(size), 1.0, float(FROM_REST)]
                code._keep([*stress, *stress, *rest], way)
            for value, place in ((1.0, _ALIVE), (np.inf, _CHANGE), (0.0, _SHIFT)):
                self._keep(value, place)
            self._go_on(_NEWTON)

    def _end_newton(self) -> None:
        w, b, code, a = self._w, self._w.builder, self._code, self._a
        index = b.load(self._index)
        self._note_levels(index)
        with self._each_mode() as (_, state, way):
            end = w.at((way, 1), (self._way, 1))
            is_base = b.icmp_signed("==", index, INTEGER(0))
            of_mode = b.icmp_signed("<=", index, INTEGER(self._size))
            with b.if_then(is_base), a.apart():
                code._keep(code._kept(state, self._size), end)
            with b.if_then(b.and_(of_mode, b.not_(is_base))), a.apart():
                moved = w.at((index, 1), (-1, 1))
                width = self._width(self._kept(_LARGEST))
                column = w.at((end, 1), (self._size, 1), (moved, self._size))
                for i in range(self._size):
                    value = code._kept(w.at((state, 1), (i, 1)))
                    change = a.subtract(value, code._kept(w.at((end, 1), (i, 1))))
                    code._keep(a.divide(change, width), w.at((column, 1), (i, 1)))
        following = w.at((index, 1), (1, 1))
        b.store(following, self._index)
        with b.if_then(b.icmp_signed(">=", following, self._directions)), a.apart():
            self._improve()

    def _note_levels(self, index: Any) -> None:
        """Write where states end, or the slope of that if this pass moved them."""
        b, code, a, place = self._w.builder, self._code, self._a, 0
        for effect, (count, _) in enumerate(self._levels):
            is_base = b.icmp_signed("==", index, INTEGER(0))
            is_moved = b.icmp_signed("==", index, INTEGER(1 + self._size + effect))
            for _ in range(count):
                now, end, slope = (self._of_level(which, place) for which in range(3))
                reached = code._kept(self._levels_at + place)
                with b.if_then(is_base), a.apart():
                    code._keep(reached, end)
                    code._keep(0.0, slope)
                with b.if_then(is_moved), a.apart():
                    change = a.subtract(reached, code._kept(end))
                    code._keep(a.divide(change, self._width(code._kept(now))), slope)
                place += 1

    def _improve(self) -> None:
        """Write Newton's step, and whether any vector needs another."""
        w, b, code, a, size = self._w, self._w.builder, self._code, self._a, self._size
        write = code._write
        alive, shift = self._kept(_ALIVE), self._kept(_SHIFT)
        before = self._kept(_CHANGE)
        self._keep(0.0, _CHANGE)
        with self._each_mode() as (number, _, way):
            mode = code._tree("mode", code._of_mode, number)
            end = w.at((way, 1), (self._way, 1))
            found, moved, hope = write(
                improved, mode.relaxation_time, self._kept(_PERIOD), alive, shift,
                code._kept(way, self._way), code._kept(end, size),
                code._kept(w.at((end, 1), (size, 1)), size, size),
            )  # fmt: skip
            code._keep(found, way)
            self._keep(a.larger(self._kept(_CHANGE), moved[()]), _CHANGE)
            self._keep(a.multiply(self._kept(_ALIVE), hope[()]), _ALIVE)
        largest: Any = 0.0
        for i in range(self._count):
            now, end, slope = (code._kept(self._of_level(which, i)) for which in range(3))
            level, moved = write(improved_level, alive, now, end, slope)
            code._keep(level[()], self._of_level(0, i))
            largest = a.larger(largest, moved[()])
        change = a.larger(self._kept(_CHANGE), largest)
        moving = a.compare(">", alive, 0.0)
        self._keep(a.chosen(moving, largest, shift), _SHIFT)
        change = a.chosen(moving, change, before)
        self._keep(change, _CHANGE)
        # what is no number goes on until there is no hope
        arrived = a.compare("<", change, TOLERANCE)
        self._keep(a.chosen(arrived, 0.0, self._kept(_ALIVE)), _ALIVE)
        some = a.in_some(a.compare(">", self._kept(_ALIVE), 0.0))
        b.store(b.select(some, INTEGER(_NEWTON), INTEGER(_CLOSING)), self._stage)
        b.store(INTEGER(0), self._index)
