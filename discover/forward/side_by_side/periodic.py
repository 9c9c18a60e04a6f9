"""Sweeps of many vectors of parameters: every oscillation in steady alternation is a lane."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from discover.effects import KinematicEffect
from discover.forward.augmented_fluid import AugmentedFluid
from discover.forward.declared import Numbers
from discover.forward.periodic_states import MOST_CYCLES, NEWTON_STEP, mirror
from discover.forward.side_by_side.code import Code, lanes_last
from discover.forward.side_by_side.cycles import approximation
from discover.forward.side_by_side.kernel import Kernel
from discover.forward.side_by_side.predictors import (
    Asked,
    StatePredictor,
    flows_of,
    in_whole_eights,
)
from discover.forward.side_by_side.step import WEIGHTS, Mode, Shared, Step
from discover.forward.steady_states import goes_on, next_approximation, relative_change
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
        """Return the next start of a cycle, by how much it moved, and whether it goes on.

        Half a cycle later the state is mirrored, by the signs in `back`.
        """
        size = len(end)
        now = approximation(way, size)
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


class PeriodicCode(Code):
    """Machine code for periodic states of modes that nothing couples."""

    counts, arrays, wide, whole = _COUNTS, _ARRAYS, _WIDE, _WHOLE

    def __init__(
        self, fluid: AugmentedFluid, found: tuple[Mode, Shared], flow: Kinematics | None = None
    ):
        super().__init__(fluid, found, flow)
        self._step = PeriodicStep(fluid, self._plain_law, ())
        variables, tensors = self._law.variables, self._law.tensors
        self._back = mirror(variables - 4 * tensors, tensors)
        self._weights = (self._kinds, WEIGHTS) if self._kinds > 1 else (WEIGHTS,)
        self._way_at = _WEIGHTS + self._kinds * WEIGHTS
        self._way_size = 3 * self.size + 3
        self._now_at = self._way_at + self._way_size
        self._make(fluid, found)

    def __call__(self, used: np.ndarray, given: dict[str, np.ndarray]) -> np.ndarray:
        """Return G′ + iG″ of the modes in Pa, shape (groups, lanes).

        `given`: amplitudes, frequencies, modes and what these share, groups first and lanes last;
        the steps of half a cycle of each group, and cosine and sine at their ends and middles.
        """
        groups, modes = given["mode"].shape[:2]
        storage, loss = np.empty((2, groups, LANES))
        arrays = given | {
            "flags": used.astype(np.int64), "storage": storage, "loss": loss,
            "scratch": np.empty((self._now_at + self.size * (1 + self.size), LANES)),
            "goes_on": np.ones(1, np.int64),
        }  # fmt: skip
        self._run((groups, modes, given["cosine"].shape[1]), arrays)
        return storage + 1j * loss

    def _body(self) -> None:
        w, a = self._w, self._arithmetic
        on = self._truths() | dict.fromkeys(("series", "states", "times"), False)
        on["own weights"] = True
        modes = w.counts["modes"]
        with w.loop(w.counts["groups"]) as group, a.apart():
            shared = self._tree("shared", self._shared, group)
            for name in ("storage", "loss"):
                w.store(a.lanes(0.0), name, group)
            with w.loop(modes) as number, a.apart():
                mode = self._tree("mode", self._of_mode, w.at((group, modes), (number, 1)))
                self._of_mode_alone(group, shared, mode, on)

    def _of_mode_alone(self, group, shared, mode, on) -> None:
        w, write, a, size = self._w, self._write, self._arithmetic, self.size
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
        with w.loop(MOST_CYCLES + 1, self._goes_on), a.apart():
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
            self._go_on_if(a.compare(">", self._kept(_ALIVE), 0.0))
        self._harmonic(group, shared, mode, on, frequency, strain, steps)

    def _harmonic(self, group, shared, mode, on, frequency, strain, steps) -> None:
        """Add the first harmonic of the half cycle that begins with what was found."""
        w, write, a, size = self._w, self._write, self._arithmetic, self.size
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


# Eights of states that one call of the code takes
_AT_ONCE = 2

# Of the secant most steps, the relative change of the strain that ends it, and its bounds
_MOST_SECANTS, _TOLERANCE, _SECANT = 40, 1e-8, (0.2, 5.0)


class PeriodicSideBySide(StatePredictor):
    """Predictions of moduli for one structure of law and effects.

    `cycles`: makes the code of transients that begin with a cycle, for vectors whose states change
    in it. `rates`: as of `StatePredictor`. `given_way`, `recorded`: of a vector, states, felt
    strains and moduli of the modes: by how much the tool turns further than the fluid; and with the
    felt rates, what is recorded.
    """

    def __init__(
        self,
        fluid: AugmentedFluid,
        code: PeriodicCode,
        cycles: Callable[[], Kernel],
        rates: Callable,
        given_way: Callable,
        recorded: Callable,
    ):
        acting = [e for e in fluid.structure.effects if e.acts_on_steady_states]
        shaping = [e for e in acting if isinstance(e, KinematicEffect)]
        super().__init__(fluid, code, shaping, rates)
        self._cycles = cycles
        self._states = self._amplitudes(e for e in fluid.states if e.acts_on_steady_states)
        self._series = self._amplitudes(fluid.series)
        still = [*self._amplitudes(e for e in fluid.states), *self._series]
        self._still = [at for at in still if at not in self._states]

        def of_solvent(function: Callable) -> Callable:
            def of(numbers: Numbers, solvent, *others):
                return function(replace(numbers, solvent_viscosity=solvent), *others)

            return of

        self._given_way = self._program(of_solvent(given_way), (None, 0, 0, None, 0, 0))
        self._recorded = self._program(of_solvent(recorded), (None, 0, 0, None, None, 0, 0, 0))

    def predict(self, asked: Asked) -> Float[np.ndarray, "trials states 2"]:
        """Return both moduli."""
        part = asked.part
        rate = self._felt(asked, (part.frequency * part.strain)[None])[:, 0]
        strain, of_modes = self._answered(asked, rate / part.frequency)
        present = self._fluid.present(asked.thetas)
        return self._of_eights(
            asked, lambda own, at: self._recorded(
                asked.numbers, own.moduli[:, -1], own.thetas, present, part, strain[at],
                of_modes[at], rate[at],
            ),
        )  # fmt: skip

    def _of_eights(self, asked: Asked, of: Callable[[Asked, np.ndarray], Any]) -> np.ndarray:
        """Return what is found of eight vectors at a time, and where these stand."""
        count = len(asked.thetas)
        each = in_whole_eights(count).reshape(-1, LANES)
        return np.concatenate([of(asked.taken(at), at) for at in each])[:count]

    def _answered(self, asked: Asked, strain: Float[np.ndarray, "trials states"]):
        """Return the strain that the fluid feels of the tool's, and the moduli of its modes.

        What gives way in series takes its share of the first harmonic alone. The secant finds the
        amplitude that is left, along the logarithms of both.
        """
        felt, of_modes = strain.copy(), self._of_modes(asked, strain)
        trials = np.flatnonzero(np.any(asked.thetas[:, self._series], axis=1))
        before, lacked = felt.copy(), np.zeros(felt.shape)
        for _ in range(_MOST_SECANTS):
            if not len(trials):
                break
            own = asked.taken(trials)
            now, found = felt[trials], of_modes[trials]

            def further(eight: Asked, at: np.ndarray, now=now, found=found):
                solvent = eight.moduli[:, -1]
                return self._given_way(
                    eight.numbers, solvent, eight.thetas, eight.part, now[at], found[at]
                )

            taken = self._of_eights(own, further)
            lacking = np.log(strain[trials] / now) - np.log(np.abs(taken))
            passed = np.log(now / before[trials])
            moved = passed != 0.0
            slope = (lacked[trials] - lacking) / np.where(moved, passed, 1.0)
            # 1 of a linear fluid; small of one that thins and gives way
            slope = np.where(moved, np.clip(slope, *_SECANT), 1.0)
            change = lacking / slope
            before[trials], lacked[trials] = now, lacking
            felt[trials] = now * np.exp(change)
            trials = trials[np.any(np.abs(change) > _TOLERANCE, axis=1)]
            if len(trials):
                of_modes[trials] = self._of_modes(asked.taken(trials), felt[trials])
        of_modes[trials] = np.nan
        return felt, of_modes

    def _of_modes(self, asked: Asked, strain: Float[np.ndarray, "trials states"]) -> np.ndarray:
        """Return the complex moduli of the modes, shape (trials, states)."""
        out = np.empty(strain.shape, complex)
        changing = np.any(asked.thetas[:, self._states], axis=1)
        for which, solve in ((changing, self._in_cycles), (~changing, self._of_each_mode)):
            if np.any(which):
                out[which] = solve(asked.taken(which), strain[which])
        return out

    def _in_cycles(self, asked: Asked, strain: Float[np.ndarray, "trials states"]) -> np.ndarray:
        """Return the moduli of modes that states of the fluid couple, each state a run."""
        part, steps = asked.part, 2 * asked.part.steps.astype(np.int64)
        frequency, most = part.frequency, int(np.max(steps))
        thetas = asked.thetas.copy()
        thetas[:, self._still] = 0.0
        width = np.repeat((2.0 * np.pi / (frequency * steps))[:, None], most, axis=1)
        phase = np.arange(2 * most + 1) * (np.pi / steps[:, None])
        wave = frequency[:, None] * np.cos(phase)
        # of what is periodic the sum over a period is exact to all orders
        ends = np.arange(1, most + 1) <= steps[:, None]
        harmonic = np.where(ends, 2j * np.exp(-1j * phase[:, 2::2]), 0.0) / steps[:, None]
        packed = self._packed(asked.numbers, thetas, asked.moduli)

        def eight(lanes: np.ndarray, used: np.ndarray) -> np.ndarray:
            amplitude = strain[lanes].T
            given = packed.of_eight(lanes, asked.declared) | {
                "rate": wave[:, :, None] * amplitude[:, None], "table": np.zeros(WEIGHTS),
                "last": steps, "pieces": np.ones(width.shape, np.int64),
                "cycle": np.stack([np.zeros_like(steps), steps], axis=1),
                "width": width, "share": np.ones(width.shape), "period": 2.0 * np.pi / frequency,
                "jump": np.zeros(len(steps)), "flow": flows_of(None),
            }  # fmt: skip
            _, _, of_modes = self._cycles()(0, used, given, normal=True)
            stress = np.where(ends[:, :, None], of_modes[:, 1:, 3], 0.0)
            return (np.sum(harmonic[:, :, None] * stress, axis=1) / amplitude).T

        return self._by_eights(thetas, (), eight)

    def _of_each_mode(self, asked: Asked, strain: Float[np.ndarray, "trials states"]) -> np.ndarray:
        """Return the moduli of modes each of which is solved for by itself."""
        part, packed = asked.part, self._packed(*asked[:3])
        frequency, steps = part.frequency, part.steps.astype(np.int64)
        out = np.empty((len(asked.thetas), len(frequency)), complex)

        def solve(used: np.ndarray, trial: np.ndarray, state: np.ndarray) -> None:
            own = steps[state[::LANES]]
            half = np.arange(2 * own.max() + 1) * (0.5 * np.pi / own[:, None])
            given = packed.of_lanes(trial, asked.declared) | {
                "strain": lanes_last(strain[trial, state]),
                "frequency": lanes_last(frequency[state]),
                "steps": own, "cosine": np.cos(half), "sine": np.sin(half),
            }  # fmt: skip
            out[trial, state] = self._code(used, given).ravel()

        # those of a group take as many steps
        alike = [np.flatnonzero(steps == count) for count in np.unique(steps)]
        self._by_states(asked.thetas, alike, _AT_ONCE, solve)
        return out
