"""The loops over runs, steps and modes, in machine code for eight vectors of parameters at once.

`step` says what is done in them. Arrays have the lanes last, and each run is followed to its own
end.
"""

from functools import reduce
from itertools import pairwise
from typing import Any

import numpy as np

from discover.forward.augmented_fluid import AugmentedFluid
from discover.forward.side_by_side.code import Code
from discover.forward.side_by_side.code import as_array as _array
from discover.forward.side_by_side.cycles import periodic_starts
from discover.forward.side_by_side.step import WEIGHTS, Mode, Shared, Step
from discover.programs.lanes import LANES
from discover.programs.lanes.arithmetic import INTEGER
from discover.protocols.kinematics import Kinematics

_COUNTS = ("runs", "steps", "modes", "tabled", "normal", "ends")
# of all modes and lanes: rates, parameters and modes of each vector; and what is written
_WIDE = ("rate", "shared", "mode", "stress", "felt", "of_modes", "state", "scratch")
_WHOLE = ("first", "last", "behind", "pieces", "flags", "taken")
_SCALAR = ("width", "share", "table", "flow", "jump")
_ARRAYS = (*_WIDE, *_WHOLE, *_SCALAR)

# Where in the scratch array what stands; the last few, and the modes behind them, are the state
# that is carried from step to step
_TAKEN, _SUM, _OTHER_SUM, _BEGIN, _MOVED, _STATE = range(6)
_MISSING, _EARLIER, _SHEARED, _RECORDED, _LEVELS = range(_STATE, _STATE + 5)

# Pieces of a step from which on it may end early, once a state is steady at a rate that is felt as
# constant, and by how much it may then still change until the end: nothing that is seen, as a
# steady state comes nearer with every piece
FEWEST, STEADY = 8, 1e-9

# A stress over its modulus, and a state of the fluid, of which changes are no longer relative
_SMALL, _SMALL_STATE = 1e-3, 1e-2


class Kernel(Code):
    """Machine code for flows at a given rate in time.

    A step is followed in pieces of one length, until all eight vectors are steady. `steps_taken`:
    pieces that eight vectors took at once, in all calls so far.
    """

    counts, arrays, wide, whole = _COUNTS, _ARRAYS, _WIDE, _WHOLE

    def __init__(self, fluid: AugmentedFluid, found: tuple[Mode, Shared], flow: Kinematics | None):
        super().__init__(fluid, found, flow)
        self.steps_taken = 0
        self._times_at, self._states_at = map(self.flags.names.index, ("times", "states"))
        self._step = Step(fluid, self._plain_law)
        self._levels = [(e.levels, e.rest) for e in fluid.states]
        self._series = bool(fluid.series)
        self._state_at = _LEVELS + sum(levels for levels, _ in self._levels)
        self._weights = self._kinds * WEIGHTS  # of a mode
        self._make(fluid, found, flow)

    def __call__(
        self,
        tabled: int,
        used: np.ndarray,
        given: dict[str, np.ndarray],
        normal: bool = False,
        mirrored: bool = False,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return stress and felt rate at step ends, and the modes'.

        Shapes (runs, ends, lanes), NaN where none was computed; of the modes σ11, σ22, σ33, σ12
        and their structure variables, (runs, ends, s, lanes), empty unless `normal`. `tabled`:
        modes whose weights stand in the table. `used`: parts that a vector needs; see `Flags`.
        `mirrored`: whether cycles are halves, after which the flow is its own image in the plane
        across it.
        """
        (runs, steps), modes = given["width"].shape, len(given["mode"])
        stress = np.full((runs, steps + 1, LANES), np.nan)
        felt = np.zeros_like(stress)
        of_modes = np.full((runs, steps + 1, self.size if normal else 0, LANES), np.nan)
        of_modes[:, 0] = 0.0
        flags = used.astype(np.int64)
        flags[-1] = used[self._times_at]
        size = self._state_at + modes * self.size
        signs = np.ones((self.size, 1))
        signs[3 : 4 * (1 + self._law.tensors) : 4] -= 2.0 * mirrored
        last, (start, end) = given["last"], given["cycle"].T
        begins = start >= 0

        def follow(state, first, behind, records, ends=False) -> None:
            """Follow runs from one step to another, and let `state` hold where that ends."""
            # the state stands there twice: as it was before a piece, too
            room = 2 * size - _STATE + modes * self._weights
            scratch, taken = np.empty((room, LANES)), np.zeros(1, np.int64)
            arrays = given | {
                "flags": flags, "scratch": scratch, "taken": taken, "state": state,
                "first": first, "behind": behind, **records,
            }  # fmt: skip
            tells = int(normal and records is own)
            self._run((runs, steps, modes, tabled, tells, int(ends)), arrays)
            self.steps_taken += int(taken[0])

        def after(levels, of_each, some):
            """Return what a cycle makes of states and modes, of some of the runs."""
            state = self._as_state(levels, of_each)
            follow(state, start, np.where(some, end, start), nowhere)
            levels, of_each = self._parts(state)
            return levels, of_each * signs

        own = {"stress": stress, "felt": felt, "of_modes": of_modes}
        nowhere = {"stress": stress.copy(), "felt": felt.copy(), "of_modes": of_modes}
        at_rest = [np.full((runs, count, LANES), rest) for count, rest in self._levels]
        rest = np.concatenate([np.zeros((runs, 0, LANES)), *at_rest], axis=1)
        still = np.zeros((runs, modes, self.size, LANES))
        state, recorded = self._as_state(rest, still), np.where(begins, start, last)
        follow(state, np.zeros_like(last), recorded, own, ends=not np.any(begins))
        if np.any(begins):
            slowness = given["mode"][:, 1] / given["period"][:, None, None]  # behind the modulus
            places = np.cumsum([0, *(count for count, _ in self._levels)]).tolist()
            effects = [slice(*ends) for ends in pairwise(places)] if used[self._states_at] else []
            found = periodic_starts(after, rest, still, slowness, effects, begins)
            state[begins] = self._as_state(*found)[begins]
            if not mirrored:  # what gives way in series has come to its own by the end of a cycle
                follow(state, start, np.where(begins, end, start), nowhere)
            follow(state, recorded, last, own, ends=True)
        return stress, felt, of_modes

    def _as_state(self, levels: np.ndarray, modes: np.ndarray) -> np.ndarray:
        """Return the state that is carried from step to step, with nothing else in it."""
        beside = np.zeros((len(levels), _LEVELS - _STATE, LANES))
        flat = modes.reshape(len(modes), -1, LANES)
        return np.concatenate([beside, levels, flat], axis=1)

    def _parts(self, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return states of the fluid and modes."""
        _, levels, flat = np.split(state, [_LEVELS - _STATE, self._state_at - _STATE], axis=1)
        return levels, flat.reshape(len(state), -1, self.size, LANES)

    def _body(self) -> None:
        w = self._w
        first = [w.load("shared", i) for i in range(self._shared.size)]
        self._parameters = self._shared.tree(first)
        self._on = self._truths()
        self._moves = w.builder.alloca(INTEGER)
        self._numbers = w.at((w.counts["modes"], self.size), (self._state_at - _STATE, 1))
        self._weights_at = w.at((self._numbers, 2), (_STATE, 1))
        with w.loop(w.counts["runs"]) as run, self._arithmetic.apart():
            self._of_run(run)

    def _splat(self, name: str, place: Any) -> Any:
        return self._arithmetic.splat(self._w.load(name, place))

    def _of_run(self, run) -> None:
        w, size = self._w, self._flow.size
        kinematics = [self._splat("flow", w.at((run, size), (i, 1))) for i in range(size)]
        flow = self._flow.tree(kinematics) if size else None
        state = w.at((run, self._numbers))
        with w.loop(self._numbers) as number, self._arithmetic.apart():
            held = w.load("state", w.at((state, 1), (number, 1)))
            self._keep(held, w.at((number, 1), (_STATE, 1)))
        self._settle(flow)
        first, behind = w.load("first", run), w.load("behind", run)
        with w.loop(w.builder.sub(behind, first)) as number, self._arithmetic.apart():
            self._of_interval(run, w.at((number, 1), (first, 1)), flow)
        with w.loop(self._numbers) as number, self._arithmetic.apart():
            held = self._kept(w.at((number, 1), (_STATE, 1)))
            w.store(held, "state", w.at((state, 1), (number, 1)))
        ends = w.builder.icmp_signed("!=", w.counts["ends"], INTEGER(0))
        with w.builder.if_then(ends), self._arithmetic.apart():
            self._at_start(run, flow)
            with w.loop(w.load("last", run)) as number, self._arithmetic.apart():
                self._beside(run, number, flow)

    def _settle(self, flow) -> None:
        """Write the stress of modes that were not reached by a step before."""
        w, add = self._w, self._arithmetic.add
        for place in (_TAKEN, _SHEARED):
            self._keep(0.0, place)
        with w.loop(w.counts["modes"]) as number, self._arithmetic.apart():
            mode, at = self._tree("mode", self._of_mode, number), self._place_of_mode(number)
            sheared, _ = self._write(self._step.felt, mode, flow, self._kept(at, self.size))
            self._keep(add(self._kept(_SHEARED), sheared[()]), _SHEARED)

    def _place_of_mode(self, number) -> Any:
        return self._w.at((number, self.size), (self._state_at, 1))

    def _of_interval(self, run, number, flow) -> None:
        """Write a step in all its pieces, and what is recorded at its end."""
        w, b, a, steps = self._w, self._w.builder, self._arithmetic, self._w.counts["steps"]
        half = w.at((run, w.at((steps, 2), (1, 1))), (number, 2))
        rates = [w.load("rate", w.at((half, 1), (i, 1))) for i in range(3)]
        place = w.at((run, steps), (number, 1))
        count, share, width = w.load("pieces", place), *(
            self._splat(name, place) for name in ("share", "width")
        )  # fmt: skip
        several = b.icmp_signed(">", count, INTEGER(1))
        changes = a.in_some(a.compare("!=", rates[0], rates[2]))
        may_end = b.and_(b.icmp_signed(">=", count, INTEGER(FEWEST)), b.not_(changes))
        with b.if_then(b.not_(self._on["times"])), a.apart():
            self._weigh(width)
        self._keep(0.0, _BEGIN)
        b.store(INTEGER(1), self._moves)

        def moves():
            return b.icmp_signed("!=", b.load(self._moves), INTEGER(0))

        with w.loop(count, moves) as piece, a.apart():
            begin = self._kept(_BEGIN)
            end = a.add(begin, share)
            ways = begin, a.multiply(0.5, a.add(begin, end)), end
            own = [
                a.chosen(several, self._rate_at(way, rates), rate)
                for way, rate in zip(ways, rates, strict=True)
            ]
            with b.if_then(may_end), a.apart():
                self._remember()
            self._of_step(run, number, flow, own, width)
            if self._series:
                is_first = b.icmp_signed("==", piece, INTEGER(0))
                with b.if_then(b.and_(self._on["series"], is_first)), a.apart():
                    self._record_taken(run, number)
            self._keep(end, _BEGIN)
            with b.if_then(may_end), a.apart():
                left = a.divide(a.subtract(1.0, end), share)
                some = a.in_some(a.compare(">", a.multiply(self._moved(), left), STEADY))
                b.store(b.zext(some, INTEGER), self._moves)
        self._record(run, number)

    def _rate_at(self, way, rates) -> Any:
        """Return the rate on the way through a step: the parabola through both ends and middle."""
        a, (first, middle, last) = self._arithmetic, rates
        bend = a.subtract(a.add(first, last), a.multiply(2.0, middle))
        line = a.add(first, a.multiply(way, a.subtract(last, first)))
        curved = a.multiply(a.multiply(2.0, bend), a.multiply(way, a.subtract(way, 1.0)))
        return a.add(line, curved)

    def _remember(self) -> None:
        """Write the state once more, behind it."""
        w = self._w
        with w.loop(self._numbers) as number:
            place = w.at((number, 1), (_STATE, 1))
            self._keep(self._kept(place), w.at((place, 1), (self._numbers, 1)))

    def _moved(self) -> Any:
        """Return by how much the state is another than the one remembered, of its own size."""
        w, a = self._w, self._arithmetic
        self._keep(0.0, _MOVED)

        def seen(first: Any, count: int, scale: Any) -> None:
            now, before = (
                self._kept(place, count) for place in (first, w.at((first, 1), (self._numbers, 1)))
            )
            sizes = [a.size(a.subtract(*pair)) for pair in zip(now, before, strict=True)]
            moved = a.divide(reduce(a.larger, sizes), scale)
            self._keep(a.larger(self._kept(_MOVED), moved), _MOVED)

        for place in range(_LEVELS, self._state_at):
            seen(place, 1, a.add(a.size(self._kept(place)), _SMALL_STATE))
        with w.loop(w.counts["modes"]) as number, a.apart():
            at = self._place_of_mode(number)
            seen(at, 4, a.add(a.size(self._kept(w.at((at, 1), (3, 1)))), _SMALL))
            if self.size > 4:
                seen(w.at((at, 1), (4, 1)), self.size - 4, 1.0)
        return self._kept(_MOVED)

    def _of_step(self, run, number, flow, rates, width) -> None:
        w, counts, write, step = self._w, self._w.counts, self._write, self._step
        shared, on, add = self._parameters, self._on, self._arithmetic.add
        w.store(w.at((w.load("taken", 0), 1), (1, 1)), "taken", 0)
        levels, earlier = self._states(self._levels, _LEVELS), self._kept(_EARLIER)
        before, scale_last, slow = write(
            step.before_modes, shared, on, flow, levels, self._kept(_SHEARED), rates[1], width
        )
        with w.builder.if_then(on["times"]), self._arithmetic.apart():
            self._weigh(self._arithmetic.divide(width, slow[1]))
        if self._series:
            with w.builder.if_then(on["series"]), self._arithmetic.apart():
                self._foresee(run, number, flow, width, slow, rates, before, scale_last)
        taken = self._kept(_TAKEN)
        self._keep(np.zeros(2), _SUM)
        with w.loop(counts["modes"]) as mode_number, self._arithmetic.apart():
            mode, weights, stress, at = self._mode(run, number, mode_number)
            after = write(
                step.of_mode,
                shared, mode, on, flow, slow, stress, tuple(rates), taken, earlier, weights,
            )  # fmt: skip
            self._keep(after, at)
            sheared, recorded = write(step.felt, mode, flow, after)
            self._keep(add(self._kept(_SUM), sheared[()]), _SUM)
            if flow is not None:
                self._keep(add(self._kept(_OTHER_SUM), recorded[()]), _OTHER_SUM)
        sheared = self._kept(_SUM)
        recorded = sheared if flow is None else self._kept(_OTHER_SUM)
        self._keep(sheared, _SHEARED)
        after, sheared, recorded = write(
            step.after_modes,
            shared, on, flow, levels, add(rates[1], taken), width, before, scale_last, sheared,
            recorded,
        )  # fmt: skip
        self._keep_states(after, _LEVELS)
        if self._series:
            with w.builder.if_then(on["series"]), self._arithmetic.apart():
                missing = write(
                    step.missing,
                    shared, on, flow, tuple(rates), width, before, sheared, self._kept(_MISSING),
                    taken,
                )  # fmt: skip
                self._keep(missing[()], _MISSING)
        self._keep(taken, _EARLIER)
        self._keep(recorded[()], _RECORDED)

    def _foresee(self, run, number, flow, width, slow, rates, before, scale_last) -> None:
        """Write what series elements take in a step."""
        w, write, step, add = self._w, self._write, self._step, self._arithmetic.add
        shared, on, earlier = self._parameters, self._on, self._kept(_EARLIER)
        sums = (_SUM, _OTHER_SUM)
        self._keep(np.zeros(2), _SUM)
        with w.loop(w.counts["modes"]) as mode_number, self._arithmetic.apart():
            mode, weights, stress, _ = self._mode(run, number, mode_number)
            rate = add(rates[0], earlier)
            found = write(step.foreseen, shared, mode, on, flow, slow, stress, rate, weights)
            for place, value in zip(sums, found, strict=True):
                self._keep(add(self._kept(place), value[()]), place)
        taken = write(
            step.taken,
            shared, on, flow, tuple(rates), width, self._splat("jump", run), before,
            self._kept(_MISSING), earlier, scale_last, tuple(self._kept(place) for place in sums),
        )  # fmt: skip
        self._keep(taken[()], _TAKEN)

    def _weigh(self, width) -> None:
        """Write the weights of a step of each mode of its own: of one length in the mode's time.

        All pieces of a step have the same, but where states change the times.
        """
        w, apart = self._w, self._arithmetic.apart
        with (
            w.loop(w.counts["modes"]) as number, w.builder.if_then(self._is_own(number)), apart(),
        ):  # fmt: skip
            mode, on = self._tree("mode", self._of_mode, number), {"own weights": True}
            weights = self._write(self._step.weights, mode, on, width, np.zeros(WEIGHTS))
            self._keep(weights, w.at((number, self._weights), (self._weights_at, 1)))

    def _is_own(self, number) -> Any:
        """Return whether the weights of a mode are its own, and not those of the table."""
        b = self._w.builder
        untabled = b.icmp_signed(">=", number, self._w.counts["tabled"])
        return b.or_(self._on["own weights"], untabled)

    def _mode(self, run, number, mode_number):
        """Return a mode, the weights of its step, its stress and where that is kept."""
        w, a, counts = self._w, self._arithmetic, self._w.counts
        mode, at = self._tree("mode", self._of_mode, mode_number), self._place_of_mode(mode_number)
        place = w.at((mode_number, self._weights), (self._weights_at, 1))
        weights = self._kept(place, self._weights)
        if self._kinds == 1:
            own = self._is_own(mode_number)
            # past the table's end its first row is read, and not used
            row = w.builder.select(own, INTEGER(0), mode_number)
            tabled = w.at((run, counts["steps"]), (number, 1))
            tabled = w.at((tabled, w.at((counts["tabled"], WEIGHTS))), (row, WEIGHTS))
            table = [self._splat("table", w.at((tabled, 1), (i, 1))) for i in range(WEIGHTS)]
            weights = _array([a.chosen(own, *pair) for pair in zip(weights, table, strict=True)])
        return mode, weights, self._kept(at, self.size), at

    def _record(self, run, number) -> None:
        """Write the run's stress down."""
        w, builder, a = self._w, self._w.builder, self._arithmetic
        steps, recorded, taken = w.counts["steps"], self._kept(_RECORDED), self._kept(_EARLIER)
        at = w.at((run, w.at((steps, 1), (1, 1))), (number, 1), (1, 1))
        w.store(a.lanes(recorded), "stress", at)
        w.store(a.lanes(taken), "felt", at)
        asked = builder.icmp_signed("!=", w.counts["normal"], INTEGER(0))
        with builder.if_then(asked), a.apart():
            levels = self._states(self._levels, _LEVELS)
            factor = self._write(self._step.stiffness, self._parameters, self._on, levels)[()]
            self._record_modes(at, factor, self._state_at, self.size)

    def _record_taken(self, run, number) -> None:
        """Write what series elements take at the beginning of a step: the mean of both sides."""
        w, a = self._w, self._arithmetic
        at, now = (
            w.at((run, w.at((self._w.counts["steps"], 1), (1, 1))), (number, 1)),
            self._kept(_EARLIER),
        )
        mean = a.multiply(0.5, a.add(w.load("felt", at), now))
        is_start = w.builder.icmp_signed("==", number, INTEGER(0))
        w.store(a.chosen(is_start, now, mean), "felt", at)

    def _at_start(self, run, flow) -> None:
        """Write what is felt and recorded at the start of a run, where the modes are at rest."""
        w, a, steps = self._w, self._arithmetic, self._w.counts["steps"]
        at = w.at((run, w.at((steps, 1), (1, 1))))
        rate = w.load("rate", w.at((run, w.at((steps, 2), (1, 1)))))
        felt = a.add(rate, w.load("felt", at))
        beside = self._write(self._step.beside, self._parameters, self._on, flow, felt)[()]
        w.store(a.lanes(beside), "stress", at)
        w.store(a.lanes(felt), "felt", at)

    def _beside(self, run, number, flow) -> None:
        """Write the felt rate at the end of a step, and the recorded stress with what is beside."""
        w, a, steps = self._w, self._arithmetic, self._w.counts["steps"]
        at = w.at((run, w.at((steps, 1), (1, 1))), (number, 1), (1, 1))
        rate = w.load("rate", w.at((run, w.at((steps, 2), (1, 1))), (number, 2), (2, 1)))
        # it is still what series elements take that `felt` holds
        felt = a.add(rate, w.load("felt", at))
        beside = self._write(self._step.beside, self._parameters, self._on, flow, felt)[()]
        w.store(a.lanes(a.add(w.load("stress", at), beside)), "stress", at)
        w.store(a.lanes(felt), "felt", at)
