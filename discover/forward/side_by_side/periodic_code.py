"""Periodic states in steady alternation, in machine code for eight of them at once.

Each lane holds a vector of parameters, an amplitude and a frequency of its own; those of one group
take as many steps. Nothing but the law couples a mode to itself, so every mode is solved for alone,
by the modified Newton method of `starts.periodic_states`, with its derivatives in the same pass.
"""

import jax
import jax.numpy as jnp
import numpy as np

from discover.forward.augmented_fluid import AugmentedFluid
from discover.forward.side_by_side.code import Code
from discover.forward.side_by_side.step import WEIGHTS, Mode, Shared, Step
from discover.forward.starts.half_cycles import mirror
from discover.forward.starts.modified_newton import (
    Approximation,
    goes_on,
    next_approximation,
    relative_change,
)
from discover.forward.starts.periodic_states import MOST_CYCLES, NEWTON_STEP
from discover.programs.lanes import LANES
from discover.programs.lanes.arithmetic import INTEGER
from discover.protocols.kinematics import Kinematics

_COUNTS = ("groups", "modes", "most")
_WIDE = ("strain", "frequency", "shared", "mode", "storage", "loss", "scratch")
_WHOLE = ("steps", "flags", "goes_on")
_SCALAR = ("cosine", "sine")
_ARRAYS = (*_WIDE, *_WHOLE, *_SCALAR)

# Where in the scratch array what stands, of the mode that is solved for; behind these its weights,
# its approximation, and where the cycle is now with its derivatives
_ALIVE, _CHANGE, _STORAGE, _LOSS, _WEIGHTS = range(5)


class PeriodicStep(Step):
    """The functions of which a half cycle of one mode consists."""

    def along(self, shared: Shared, mode: Mode, on, stress, tangents, rates, weights):
        """Return a mode after a step, and the derivatives of it in directions, those first."""

        def of(stress):
            return self.of_mode(
                shared, mode, on, None, jnp.ones(3), stress, rates, 0.0, 0.0, weights
            )

        return jax.vmap(lambda unit: jax.jvp(of, (stress,), (unit,)), out_axes=(None, 0))(tangents)

    def improved(self, mode: Mode, frequency, back, alive, change, way, end, tangents):
        """Return the next approximation of the start of a cycle, and whether it is gone through.

        Half a cycle later the state is mirrored, by the signs in `back`.
        """
        size = len(end)
        now = _approximation(way, size)
        jacobian = (tangents * back)[None]
        following, better = next_approximation(now, (back * end)[:, None], jacobian)
        slowness = (frequency * mode.relaxation_time)[None]
        moved = relative_change(now, following, slowness, NEWTON_STEP)
        moved = jnp.where(better[0], moved, jnp.inf)
        further = goes_on(following, moved, MOST_CYCLES, NEWTON_STEP)
        flat = jnp.concatenate([jnp.ravel(part) for part in following])
        moving = alive > 0.0
        return (
            jnp.where(moving, flat, way),
            jnp.where(moving, moved, change),
            jnp.where(moving & further, 1.0, 0.0),
        )


def _approximation(way, size: int) -> Approximation:
    """Return what `improved` makes of its numbers, which follow one another."""
    stress, best, rest = way[:size], way[size : 2 * size], way[2 * size :]
    return Approximation(
        stress[:, None], best[:, None], rest[:1], rest[1 : size + 1, None], rest[-2:-1], rest[-1]
    )


class PeriodicCode(Code):
    """Machine code for periodic states.

    No state of the fluid changes with the modes in it, and nothing gives way in series.

    `flags`: which parts of it a vector needs.

    Raises NotTranslatable if a law or an effect does what is not known in lanes.
    """

    counts, arrays, wide, whole = _COUNTS, _ARRAYS, _WIDE, _WHOLE

    def __init__(
        self, fluid: AugmentedFluid, found: tuple[Mode, Shared], flow: Kinematics | None = None
    ):
        super().__init__(fluid, found, flow)
        self._step = PeriodicStep(fluid, self._plain_law, ())
        variables, tensors = self._law.variables, self._law.tensors
        self._back = mirror(variables - 4 * tensors, tensors)
        self._size = 4 + variables
        kinds = 1 if found[0].relaxations is None else 2 * found[0].relaxations.shape[1]
        self._weights = (kinds, WEIGHTS) if kinds > 1 else (WEIGHTS,)
        self._way_at = _WEIGHTS + kinds * WEIGHTS
        self._way_size = 3 * self._size + 3
        self._now_at = self._way_at + self._way_size
        self._make(fluid, found)

    def __call__(self, used: np.ndarray, given: dict[str, np.ndarray]) -> np.ndarray:
        """Return G′ + iG″ of the modes in Pa, shape (groups, lanes).

        `used`: parts of the program that one of the vectors needs; see `Flags`. `given`:
        amplitudes, frequencies, modes and what these share, groups first and lanes last; the steps
        of half a cycle of each group, and cosine and sine at their ends and middles.
        """
        groups, modes = given["mode"].shape[:2]
        storage, loss = np.empty((2, groups, LANES))
        scratch = np.empty((self._now_at + self._size * (1 + self._size), LANES))
        arrays = given | {
            "flags": used.astype(np.int64), "storage": storage, "loss": loss, "scratch": scratch,
            "goes_on": np.ones(1, np.int64),
        }  # fmt: skip
        laid = [np.ascontiguousarray(arrays[name]) for name in _ARRAYS]
        most = given["cosine"].shape[1]
        self._call(groups, modes, most, *(array.ctypes.data for array in laid))
        return storage + 1j * loss

    def _body(self) -> None:
        w, a = self._w, self._arithmetic
        on = self._truths() | {
            "series": False,
            "states": False,
            "times": False,
            "own weights": True,
        }
        modes = w.counts["modes"]
        with w.loop(w.counts["groups"]) as group, a.apart():
            shared = self._tree("shared", self._shared, group)
            for name in ("storage", "loss"):
                w.store(a.lanes(0.0), name, group)
            with w.loop(modes) as number, a.apart():
                mode = self._tree("mode", self._of_mode, w.at((group, modes), (number, 1)))
                self._of_mode_alone(group, shared, mode, on)

    def _of_mode_alone(self, group, shared, mode, on) -> None:
        w, write, a, size = self._w, self._write, self._arithmetic, self._size
        frequency, strain = w.load("frequency", group), w.load("strain", group)
        steps = a.splat(w.builder.sitofp(w.load("steps", group), a.lanes(0.0).type.element))
        width = a.divide(np.pi, a.multiply(steps, frequency))
        blank = np.zeros(WEIGHTS)
        self._keep(write(self._step.weights, mode, on, width, blank), _WEIGHTS)
        rest = np.zeros(self._way_size)
        rest[2 * size] = np.inf
        rest[-2] = 1.0
        self._keep(rest, self._way_at)
        self._keep(1.0, _ALIVE)
        self._keep(np.inf, _CHANGE)
        w.store(INTEGER(1), "goes_on", 0)

        def anew():
            return w.builder.icmp_signed("!=", w.load("goes_on", 0), INTEGER(0))

        with w.loop(MOST_CYCLES + 1, anew), a.apart():
            self._keep(self._kept(self._way_at, size), self._now_at)
            self._keep(np.eye(size), self._now_at + size)
            with w.loop(w.load("steps", group)) as number, a.apart():
                rates, _ = self._rates(group, number, frequency, strain)
                end, tangents = write(
                    self._step.along, shared, mode, on, self._kept(self._now_at, size),
                    self._kept(self._now_at + size, size, size), rates,
                    self._kept(_WEIGHTS, *self._weights),
                )  # fmt: skip
                self._keep(end, self._now_at)
                self._keep(tangents, self._now_at + size)
            way, change, alive = write(
                self._step.improved, mode, frequency, self._back, self._kept(_ALIVE),
                self._kept(_CHANGE),
                self._kept(self._way_at, self._way_size), self._kept(self._now_at, size),
                self._kept(self._now_at + size, size, size),
            )  # fmt: skip
            for value, place in ((way, self._way_at), (change, _CHANGE), (alive, _ALIVE)):
                self._keep(value, place)
            some = a.in_some(a.compare(">", self._kept(_ALIVE), 0.0))
            w.store(w.builder.zext(some, INTEGER), "goes_on", 0)
        self._harmonic(group, shared, mode, on, frequency, strain, steps)

    def _harmonic(self, group, shared, mode, on, frequency, strain, steps) -> None:
        """Add the first harmonic of the half cycle that begins with what was found."""
        w, write, a, size = self._w, self._write, self._arithmetic, self._size
        start = self._kept(self._way_at, size)
        self._keep(start, self._now_at)
        self._keep(0.0, _STORAGE)
        self._keep(a.multiply(0.5, start[3]), _LOSS)
        ones = np.ones(3)
        last = w.at((w.load("steps", group), 1), (-1, 1))
        with w.loop(w.load("steps", group)) as number, a.apart():
            rates, (sine, cosine) = self._rates(group, number, frequency, strain)
            end = write(
                self._step.of_mode, shared, mode, on, None, ones, self._kept(self._now_at, size),
                rates, 0.0, 0.0, self._kept(_WEIGHTS, *self._weights),
            )  # fmt: skip
            self._keep(end, self._now_at)
            is_last = w.builder.icmp_signed("==", number, last)
            share = a.multiply(a.chosen(is_last, 0.5, 1.0), end[3])
            for place, wave in ((_STORAGE, sine), (_LOSS, cosine)):
                self._keep(a.add(self._kept(place), a.multiply(share, wave)), place)
        found = a.compare("<", self._kept(_CHANGE), NEWTON_STEP)
        size_of = a.divide(a.multiply(2.0, mode.modulus[()]), a.multiply(steps, strain))
        size_of = a.chosen(found, size_of, np.nan)
        for name, place in (("storage", _STORAGE), ("loss", _LOSS)):
            more = a.multiply(size_of, self._kept(place))
            w.store(a.add(w.load(name, group), more), name, group)

    def _rates(self, group, number, frequency, strain):
        """Return the rates of a step, and sine and cosine of the phase at its end."""
        w, a = self._w, self._arithmetic
        first = w.at((group, w.counts["most"]), (number, 2))
        cosines = [a.splat(w.load("cosine", w.at((first, 1), (i, 1)))) for i in range(3)]
        largest = a.multiply(frequency, strain)
        rates = tuple(a.multiply(largest, cosine) for cosine in cosines)
        return rates, (a.splat(w.load("sine", w.at((first, 1), (2, 1)))), cosines[2])
