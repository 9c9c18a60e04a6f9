"""Runs at a given stress of many vectors of parameters, eight side by side."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from discover.effects import SignalEffect
from discover.forward.augmented_fluid import AugmentedFluid
from discover.forward.exponential_weights import KrogstadWeights
from discover.forward.side_by_side.code import Code
from discover.forward.side_by_side.predictors import Asked, LanePredictor, flows_of, per_run
from discover.forward.side_by_side.step import Mode, Shared, Step, _if
from discover.programs.lanes import LANES
from discover.programs.lanes.arithmetic import INTEGER
from discover.protocols.kinematics import Kinematics
from tensor_library.algebra import contracted

_COUNTS = ("runs", "steps", "modes", "normal")
_WIDE = ("imposed", "inertia", "shared", "mode", "strain", "of_modes", "scratch")
_WHOLE = ("last", "flags")
_SCALAR = ("width", "flow")
_ARRAYS = (*_WIDE, *_WHOLE, *_SCALAR)

# Where in the scratch array what stands: what is carried from step to step, sums over the modes,
# rates in the middle and at the end with the inverse of the slopes, and states of the fluid
_BEFORE, _BEND, _STRAIN, _SHEARED = range(4)
_FELT, _SLOPES, _RATES, _INVERSE, _LEVELS = 4, 6, 10, 12, 16


RATE_OF_RATE = np.array([[0.0, 1.0], [-4.0, 3.0]])
"""dγ̇/dt in the middle and at the end of a step, over 1/h, of the rates there less that before: of
the parabola through all three."""


class StressStep(Step):
    """The functions of which a step at a given stress consists."""

    # with that of the state in the middle
    kept = len(KrogstadWeights._fields)

    def at_first(self, shared: Shared, on, flow, levels, sheared, before, width):
        """Return the shear stress, the factor on the times, and those on it halfway and ahead."""
        still = (sheared, jnp.ones(()), jnp.ones(2))
        if not levels:
            return still

        def moving():
            rate = before if flow is None else flow.intensity * before
            now = self._factor("modulus_factor", shared, on, levels) * sheared
            both = self._later(shared, on, levels, rate, now, (0.5 * width, width))
            scale = [self._factor("modulus_factor", shared, on, at) for at in both]
            return now, self._factor("time_factor", shared, on, both[1]), jnp.stack(scale)

        return _if(on["states"], moving, still)

    def answered(self, shared: Shared, mode: Mode, on, flow, slow, stress, rates, weights):
        """Return what a mode adds to the recorded stress halfway and at the end, and it there."""
        w = self._of_step(mode, weights)

        @jax.jit  # so that it is traced once, and not at each of the four stages
        def remainder(state, rate):
            return self._remainder(shared, mode, on, flow, w, slow, state, rate, slow)

        there = w.along_a_line(stress, remainder, rates[0], rates[1])
        recorded = [
            mode.modulus * (at[3] if flow is None else contracted(flow.recorded, at[:4]))
            for at in there
        ]
        return jnp.stack(recorded), there[1]

    def stiff(self, shared: Shared, mode: Mode, on, flow, slow, stress, rates, weights):
        """Return the same of a mode halfway and at the end, and the slopes of both by each rate."""

        def of(rates):
            return self.answered(shared, mode, on, flow, slow, stress, rates, weights)[0]

        along = jax.vmap(lambda unit: jax.jvp(of, (rates,), (unit,)), out_axes=(None, 0))
        return along(jnp.eye(2))

    def inverse(self, shared: Shared, on, flow, scale, slopes, inertia, width):
        """Return the inverse of the slopes of the balance by the rates."""
        own = jnp.swapaxes(scale * slopes, 0, 1) + inertia / width * RATE_OF_RATE
        (a, b), (c, d) = own + self._viscous(shared, on, flow) * jnp.eye(2)
        return jnp.array([[d, -b], [-c, a]]) / (a * d - b * c)

    def corrected(
        self, shared, on, flow, scale, felt, rates, before, wanted, inertia, width, inverse
    ):
        """Return rates that are moved by what the balance misses at them."""
        accelerated = inertia / width * RATE_OF_RATE @ (rates - before)
        viscous = self._viscous(shared, on, flow) * rates
        return rates + inverse @ (wanted - scale * felt - viscous - accelerated)

    def _viscous(self, shared: Shared, on, flow):
        return self.beside(shared, on, flow and flow.driven, jnp.ones(()))


class StressCode(Code):
    """Machine code for runs at a given stress."""

    counts, arrays, wide, whole = _COUNTS, _ARRAYS, _WIDE, _WHOLE

    def __init__(self, fluid: AugmentedFluid, found: tuple[Mode, Shared], flow: Kinematics | None):
        super().__init__(fluid, found, flow)
        self._step = StressStep(fluid, self._plain_law)
        self._levels = [(e.levels, e.rest) for e in fluid.states]
        kinds, kept = self._kinds, StressStep.kept
        self._weights = (kinds, kept) if kinds > 1 else (kept,)
        # of a mode: before and after the step, and its weights
        self._numbers = 2 * self.size + kinds * kept
        self._modes_at = _LEVELS + sum(levels for levels, _ in self._levels)
        self._make(fluid, found, flow)

    def __call__(
        self, used: np.ndarray, given: dict[str, np.ndarray], normal: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the strain of the fluid, and the stress of the modes if `normal`.

        Shapes (runs, ends, lanes), and (runs, ends, s, lanes); see `Kernel.__call__`.
        """
        (runs, steps), modes = given["width"].shape, len(given["mode"])
        strain = np.full((runs, steps + 1, LANES), np.nan)
        of_modes = np.full((runs, steps + 1, self.size if normal else 0, LANES), np.nan)
        strain[:, 0], of_modes[:, 0] = 0.0, 0.0
        arrays = given | {
            "flags": used.astype(np.int64), "strain": strain, "of_modes": of_modes,
            "scratch": np.empty((self._modes_at + modes * self._numbers, LANES)),
        }  # fmt: skip
        self._run((runs, steps, modes, int(normal)), arrays)
        return strain, of_modes

    def _body(self) -> None:
        w, size = self._w, self._flow.size
        self._on = self._truths() | {"own weights": True, "series": False}
        self._parameters = self._tree("shared", self._shared, 0)
        with w.loop(w.counts["runs"]) as run, self._arithmetic.apart():
            places = [w.at((run, size), (i, 1)) for i in range(size)]
            flow = [self._arithmetic.splat(w.load("flow", place)) for place in places]
            self._keep(np.zeros(_LEVELS), 0)
            self._rest(self._levels, _LEVELS)
            with w.loop(w.at((w.counts["modes"], self._numbers))) as number:
                self._keep(0.0, w.at((number, 1), (self._modes_at, 1)))
            with w.loop(w.load("last", run)) as number, self._arithmetic.apart():
                self._of_step(run, number, self._flow.tree(flow) if size else None)

    def _of_step(self, run, number, flow) -> None:
        w, a, write, step = self._w, self._arithmetic, self._write, self._step
        shared, on, steps = self._parameters, self._on, self._w.counts["steps"]
        width = a.splat(w.load("width", w.at((run, steps), (number, 1))))
        inertia = w.load("inertia", run)
        begin = w.at((run, w.at((steps, 1), (1, 1))), (number, 1))
        end = w.at((begin, 1), (1, 1))
        from_, target = w.load("imposed", begin), w.load("imposed", end)
        halfway = a.multiply(0.5, a.add(from_, target))
        levels = self._states(self._levels, _LEVELS)
        before, bend = self._kept(_BEFORE), self._kept(_BEND)
        now, slow, scale = write(
            step.at_first, shared, on, flow, levels, self._kept(_SHEARED), before, width
        )
        bent = a.multiply(bend, width)
        self._keep([a.add(before, a.multiply(0.5, bent)), a.add(before, bent)], _RATES)
        self._keep(np.zeros(6), _FELT)
        with w.loop(w.counts["modes"]) as mode_number, a.apart():
            mode, at = self._mode(mode_number)
            own = write(step.weights, mode, on, a.divide(width, slow[()]), np.zeros(step.kept))
            self._keep(own, w.at((at, 1), (2 * self.size, 1)))
            felt, slopes = write(
                step.stiff, shared, mode, on, flow, slow, self._kept(at, self.size),
                self._kept(_RATES, 2), own,
            )  # fmt: skip
            self._add([*felt.flat, *slopes.flat], _FELT)
        slopes = self._kept(_SLOPES, 2, 2)
        inverse = write(step.inverse, shared, on, flow, scale, slopes, inertia, width)
        self._keep(inverse, _INVERSE)
        # the balance at the first rates is known by now, and then that at those which it asks for
        with w.loop(2) as _, a.apart():
            rates = write(
                step.corrected, shared, on, flow, scale, self._kept(_FELT, 2),
                self._kept(_RATES, 2), before, np.array([halfway, target], object), inertia, width,
                self._kept(_INVERSE, 2, 2),
            )  # fmt: skip
            self._keep(rates, _RATES)
            self._follow(flow, slow)
        mean, last = self._kept(_RATES, 2)
        self._keep(a.add(self._kept(_STRAIN), a.multiply(width, mean)), _STRAIN)
        self._keep(a.divide(a.multiply(2.0, a.subtract(last, mean)), width), _BEND)
        self._keep(last, _BEFORE)
        sheared = self._kept(_SHEARED)
        after, *_ = write(
            step.after_modes, shared, on, flow, levels, mean, width, now, scale[1], sheared, sheared
        )
        self._keep_states(after, _LEVELS)
        with w.loop(w.counts["modes"]) as mode_number, a.apart():
            _, at = self._mode(mode_number)
            self._keep(self._kept(w.at((at, 1), (self.size, 1)), self.size), at)
        w.store(self._kept(_STRAIN), "strain", end)
        asked = w.builder.icmp_signed("!=", w.counts["normal"], INTEGER(0))
        with w.builder.if_then(asked), a.apart():
            levels = self._states(self._levels, _LEVELS)
            factor = write(step.stiffness, shared, on, levels)[()]
            self._record_modes(end, factor, self._modes_at, self._numbers)

    def _follow(self, flow, slow) -> None:
        """Write where the modes are after a step at the rates, and what they add to the stress."""
        w, a, write, step = self._w, self._arithmetic, self._write, self._step
        self._keep(np.zeros(2), _FELT)
        self._keep(0.0, _SHEARED)
        with w.loop(w.counts["modes"]) as mode_number, a.apart():
            mode, at = self._mode(mode_number)
            felt, after = write(
                step.answered, self._parameters, mode, self._on, flow, slow,
                self._kept(at, self.size), self._kept(_RATES, 2),
                self._kept(w.at((at, 1), (2 * self.size, 1)), *self._weights),
            )  # fmt: skip
            self._keep(after, w.at((at, 1), (self.size, 1)))
            self._add(felt, _FELT)
            sheared, _ = write(step.felt, mode, flow, after)
            self._add(sheared, _SHEARED)

    def _add(self, values: Any, place: int) -> None:
        """Add values to those in the scratch array."""
        for i, value in enumerate(np.asarray(values, object).flat):
            self._keep(self._arithmetic.add(self._kept(place + i), value), place + i)

    def _mode(self, number: Any) -> tuple[Mode, Any]:
        """Return a mode, and where in the scratch array it stands."""
        at = self._w.at((number, self._numbers), (self._modes_at, 1))
        return self._tree("mode", self._of_mode, number), at


class StressSideBySide(LanePredictor):
    """Predictions of strains for one structure of law and effects.

    `driven`: of vectors, the effects present, and runs: the true stress at step ends in Pa, the
    inertia of the tool in Pa s², and the strain of what gives way in series.
    """

    def __init__(self, fluid: AugmentedFluid, code: StressCode, driven: Callable):
        super().__init__(fluid, code)
        signal = [e for e in fluid.structure.effects if isinstance(e, SignalEffect)]
        self._driving = self._amplitudes((*signal, *fluid.series))
        self._driven = driven

    def predict(self, asked: Asked) -> Float[np.ndarray, "trials runs n kinds"]:
        """Return strains, see `Asked.whole`."""
        packed, declared = self._packed(asked.numbers, asked.thetas, asked.moduli), asked.declared

        def eight(lanes: np.ndarray, used: np.ndarray) -> np.ndarray:
            return self._eight(asked, lanes, used, packed.of_eight(lanes, declared))

        return self._by_eights(asked.thetas, (), eight)

    def _eight(
        self, asked: Asked, lanes: np.ndarray, used: np.ndarray, packed: dict[str, np.ndarray]
    ) -> np.ndarray:
        """Return what is recorded of eight vectors, shape (lanes, runs, n, kinds)."""
        thetas, part = asked.thetas[lanes], jax.tree.map(np.asarray, asked.part)
        times, sample = part.times, part.sample_index
        last = np.max(sample, axis=1).astype(np.int64)
        found = [part.imposed, np.zeros(1), np.zeros(1)]
        if np.any(thetas[:, self._driving]):
            found = self._driven(per_run(thetas), self._fluid.present(thetas), part)
        imposed, inertia, given_way = (np.broadcast_to(of, (LANES, *times.shape)) for of in found)
        given = packed | {
            "imposed": np.moveaxis(imposed, 0, -1), "inertia": inertia[:, :, 0].T,
            "last": last, "width": np.diff(times), "flow": flows_of(part.kinematics),
        }  # fmt: skip
        strain, of_modes = self._code(used, given, asked.whole)
        places = np.arange(len(times))[:, None], sample
        found = np.moveaxis(strain[places], -1, 0) + given_way[:, *places]
        if not asked.whole:
            return found[..., None]
        own = np.moveaxis(of_modes[places], -1, 0)
        beside = imposed[:, *places]
        return np.concatenate([found[..., None], beside[..., None], own], axis=-1)
