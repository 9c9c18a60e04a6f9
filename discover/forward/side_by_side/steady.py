"""Flow curves of many vectors of parameters: every steady state is a lane of its own."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from discover.effects import KinematicEffect, SignalEffect
from discover.forward.augmented_fluid import AugmentedFluid, where_in_shear
from discover.forward.batches import Records, SteadyFlows
from discover.forward.declared import Numbers
from discover.forward.side_by_side.code import Code, Eights, as_array, in_whole_eights, lanes_last
from discover.forward.side_by_side.step import Flags, Mode, Shared, Step, _if
from discover.forward.starts.steady_states import (
    MOST_STEPS,
    Approach,
    approach_step,
    are_still,
    arrived,
    moves,
)
from discover.programs import compiled, in_threads
from discover.programs.lanes import LANES
from discover.programs.lanes.arithmetic import INTEGER
from discover.protocols.kinematics import Kinematics, normal_stress_differences
from tensor_library.algebra import contracted

_COUNTS = ("groups", "modes")
_WIDE = ("rate", "shared", "mode", "flow", "stress", "felt", "of_modes", "scratch")
_WHOLE = ("flags", "goes_on")
_ARRAYS = (*_WIDE, *_WHOLE)

# Where in the scratch array what stands that is carried from step to step; of each mode its state,
# and behind that the number of its next step and how many were taken again
_FELT, _INDEX, _ALIVE, _SUM, _MOVING = range(5)
_TOTAL = range(5, 9)
_LEVELS = _TOTAL.stop


class SteadyStep(Step):
    """The functions of which a step towards a steady state consists."""

    def _of_way(self, shared: Shared, mode: Mode, on, flow, slow, felt, rate):
        """Return the change of a mode, as a function of its state, and its Weissenberg number."""
        gradient = slow * mode.relaxation_time * felt
        gradient = gradient if flow is None else gradient * flow.gradient

        def change(state):
            return (self._change(shared, mode, on, state[:, 0], gradient) / slow)[:, None]

        intensity = 1.0 if flow is None else flow.intensity
        return change, (intensity * jnp.abs(rate) * mode.relaxation_time)[None]

    def onward(self, shared, mode, on, flow, levels, felt, rate, index, alive, way):
        """Return a mode after a step, whether it moves on, and the shear stress that it adds."""
        slow = self._factor("time_factor", shared, on, levels)
        change, weissenberg = self._of_way(shared, mode, on, flow, slow, felt, rate)
        law = eqx.combine(mode.law, shared.law, self._law)
        before = Approach(way[:-2, None], way[-2:-1], way[-1:])
        after = approach_step(change, before, index, weissenberg, law.variables - 4 * law.tensors)
        moving = moves(before, after, weissenberg)
        found = jnp.concatenate([after.stress[:, 0], after.number, after.again])
        found = jnp.where(alive > 0.0, found, way)
        return found, jnp.where(moving, 1.0, 0.0), self.felt(mode, flow, found[:-2])[0]

    def beside_modes(self, shared, on, flow, levels, felt, rate, sheared, alive):
        """Return the states and the rate that the fluid feels, and whether these move on."""
        sheared_rate = felt if flow is None else flow.intensity * felt
        sheared = self._factor("modulus_factor", shared, on, levels) * sheared
        after = []
        for effect, level in zip(self.states, levels, strict=True):

            def steady(effect=effect):
                values = self.fluid.values(shared.theta, effect)
                source, decay = effect.source_and_decay(values, sheared_rate, sheared)
                return source / decay

            after.append(_if(on[f"state {effect.name}"], steady, level))
        felt_after = felt
        if self.fluid.series:

            def slipping():
                # σ/γ̇ changes more slowly than σ: it converges however strong the slip
                viscosity = self.beside(shared, on, flow and flow.driven, jnp.ones(()))
                viscosity += sheared / jnp.where(felt == 0.0, 1.0, felt)
                return rate / (1.0 + self._slip(shared, flow) * viscosity)

            felt_after = _if(on["series"], slipping, felt)
        pairs = [(felt, felt_after), *zip(levels, after, strict=True)]
        moving = ~are_still(pairs)
        kept = [jnp.where(alive > 0.0, b, a) for a, b in pairs]
        return kept[0], tuple(kept[1:]), jnp.where(moving, 1.0, 0.0)

    def _slip(self, shared: Shared, flow):
        pairs = [
            e.slip_and_compliance(self.fluid.values(shared.theta, e)) for e in self.fluid.series
        ]
        return where_in_shear(flow, jnp.asarray(sum(slip for slip, _ in pairs)), jnp.zeros(()))

    def reached(self, shared, mode, on, flow, levels, felt, rate, way):
        """Return σ11, σ22, σ33, σ12 of a mode in Pa; not a number where it is not steady."""
        slow = self._factor("time_factor", shared, on, levels)
        change, weissenberg = self._of_way(shared, mode, on, flow, slow, felt, rate)
        end = arrived(change, Approach(way[:-2, None], way[-2:-1], way[-1:]), weissenberg)
        return mode.modulus * end[:4, 0]

    def recorded(self, shared, on, flow, levels, felt, of_modes):
        """Return the recorded stress with what stands beside the modes, and that of all modes."""
        of_modes = self._factor("modulus_factor", shared, on, levels) * of_modes
        recorded = of_modes[3] if flow is None else contracted(flow.recorded, of_modes)
        return recorded + self.beside(shared, on, flow, felt), of_modes


class SteadyCode(Code):
    """Machine code for steady states.

    `flags`: which parts of it a vector needs.

    Raises NotTranslatable if a law or an effect does what is not known in lanes.
    """

    counts, arrays, wide, whole = _COUNTS, _ARRAYS, _WIDE, _WHOLE

    def __init__(self, fluid: AugmentedFluid, found: tuple[Mode, Shared], flow: Kinematics | None):
        super().__init__(fluid, found, flow)
        # of a mode, and the two numbers of its way
        self._numbers = 4 + self._law.variables + 2
        states = [effect for effect in fluid.states if effect.acts_on_steady_states]
        self._step = SteadyStep(fluid, self._plain_law, states)
        self._levels = [(effect.levels, effect.rest) for effect in states]
        self._modes_at = _LEVELS + sum(levels for levels, _ in self._levels)
        self._make(fluid, found, flow)

    def __call__(self, used: np.ndarray, given: dict[str, np.ndarray]) -> tuple[np.ndarray, ...]:
        """Return the recorded stress before the signal, the felt rate, and the stress of the modes.

        The first two have the shape (groups, lanes), that of the modes is σ11, σ22, σ33, σ12, shape
        (groups, 4, lanes).

        `used`: parts of the program that one of the vectors needs; see `Flags`. `given`: rates,
        modes, what these share, and flows, by name; groups first and lanes last.
        """
        groups, modes = given["mode"].shape[:2]
        (stress, felt), of_modes = np.empty((2, groups, LANES)), np.empty((groups, 4, LANES))
        scratch = np.empty((self._modes_at + modes * self._numbers, LANES))
        flags, goes_on = used.astype(np.int64), np.ones(1, np.int64)
        arrays = given | {
            "flags": flags, "stress": stress, "felt": felt, "scratch": scratch, "goes_on": goes_on,
            "of_modes": of_modes,
        }  # fmt: skip
        laid = [np.ascontiguousarray(arrays[name]) for name in _ARRAYS]
        self._call(groups, modes, *(array.ctypes.data for array in laid))
        return stress, felt, of_modes

    def _body(self) -> None:
        w = self._w
        on = self._truths()
        with w.loop(w.counts["groups"]) as group, self._arithmetic.apart():
            shared = self._tree("shared", self._shared, group)
            flow = self._tree("flow", self._flow, group) if self._flow.size else None
            self._of_group(group, shared, on, flow, w.load("rate", group))

    def _of_group(self, group, shared, on, flow, rate) -> None:
        w, write, step, a = self._w, self._write, self._step, self._arithmetic
        modes = w.counts["modes"]
        self._keep(rate, _FELT)
        self._keep(0.0, _INDEX)
        self._keep(1.0, _ALIVE)
        self._rest(self._levels, _LEVELS)
        with w.loop(w.at((modes, self._numbers))) as number:
            self._keep(0.0, w.at((number, 1), (self._modes_at, 1)))
        w.store(INTEGER(1), "goes_on", 0)

        def goes_on():
            return w.builder.icmp_signed("!=", w.load("goes_on", 0), INTEGER(0))

        with w.loop(MOST_STEPS, goes_on), a.apart():
            levels, felt, alive = (
                self._states(self._levels, _LEVELS),
                self._kept(_FELT),
                self._kept(_ALIVE),
            )
            index = self._kept(_INDEX)
            self._keep(0.0, _SUM)
            self._keep(0.0, _MOVING)
            with w.loop(modes) as number, a.apart():
                mode, way, at = self._mode(group, number)
                after, moving, sheared = write(
                    step.onward, shared, mode, on, flow, levels, felt, rate, index, alive, way
                )
                for i, value in enumerate(after):
                    self._keep(value, w.at((at, 1), (i, 1)))
                self._keep(a.larger(self._kept(_MOVING), moving[()]), _MOVING)
                self._keep(a.add(self._kept(_SUM), sheared[()]), _SUM)
            felt, after, moving = write(
                step.beside_modes, shared, on, flow, levels, felt, rate, self._kept(_SUM), alive
            )
            self._keep(felt, _FELT)
            for place, value in enumerate(
                (value for level in after for value in level.flat), start=_LEVELS
            ):
                self._keep(value, place)
            alive = a.multiply(alive, a.larger(self._kept(_MOVING), moving[()]))
            self._keep(alive, _ALIVE)
            self._keep(a.add(index, 1.0), _INDEX)
            some = a.in_some(a.compare(">", self._kept(_ALIVE), 0.0))
            w.store(w.builder.zext(some, INTEGER), "goes_on", 0)
        levels, felt = self._states(self._levels, _LEVELS), self._kept(_FELT)
        for place in _TOTAL:
            self._keep(0.0, place)
        with w.loop(modes) as number, a.apart():
            mode, way, _ = self._mode(group, number)
            found = write(step.reached, shared, mode, on, flow, levels, felt, rate, way)
            for place, value in zip(_TOTAL, found, strict=True):
                self._keep(a.add(self._kept(place), value), place)
        total = as_array([self._kept(place) for place in _TOTAL])
        stress, of_modes = write(step.recorded, shared, on, flow, levels, felt, total)
        w.store(a.lanes(stress[()]), "stress", group)
        for i, value in enumerate(of_modes):
            w.store(a.lanes(value), "of_modes", w.at((group, 4), (i, 1)))
        w.store(felt, "felt", group)

    def _mode(self, group, number):
        """Return a mode, its way so far and where that is kept."""
        w, modes = self._w, self._w.counts["modes"]
        mode = self._tree("mode", self._of_mode, w.at((group, modes), (number, 1)))
        at = w.at((number, self._numbers), (self._modes_at, 1))
        way = [self._kept(w.at((at, 1), (i, 1))) for i in range(self._numbers)]
        return mode, as_array(way), at


# Eights of states that one call of the code takes
_AT_ONCE = 8


class SteadySideBySide:
    """Predictions of flow curves for one structure of law and effects.

    `fluid`, `code`: the fluid with its effects, and its machine code. `rates`: of a vector, the
    effects that are present, and a run: the felt rate without slip. `recorded`: of these, the
    stress and the felt rate, what is recorded. `made_from`: what tells these from those of another
    structure.
    """

    def __init__(
        self,
        fluid: AugmentedFluid,
        code: SteadyCode,
        rates: Callable,
        recorded: Callable,
        made_from: tuple,
    ):
        self._fluid, self._code, self._flags = fluid, code, Flags(fluid)
        acting = [e for e in fluid.structure.effects if e.acts_on_steady_states]
        self._shaping = [
            fluid.slices[e.name].start for e in acting if isinstance(e, KinematicEffect)
        ]
        self._distorting = [
            fluid.slices[e.name].start for e in acting if isinstance(e, SignalEffect)
        ]

        self._packed = code.packing(fluid, made_from, 0)
        of_runs = jax.vmap(rates, in_axes=(None, None, 0))
        of_trials = jax.vmap(of_runs, in_axes=(0, None, None))
        self._rates = compiled(of_trials, ("steady rates", *made_from))
        of_runs = jax.vmap(recorded, in_axes=(None, None, 0, 0, 0))
        of_trials = jax.vmap(of_runs, in_axes=(0, None, None, 0, 0))
        self._recorded = compiled(of_trials, ("steady records", *made_from))

    def predict(
        self,
        numbers: Numbers,
        thetas: Float[np.ndarray, "trials p"],
        moduli: Float[np.ndarray, "trials c"],
        limits: Float[np.ndarray, " trials"],
        part: SteadyFlows,
        judging: Records | None,
        runs: int,
        normal: bool,
    ) -> Float[np.ndarray, "trials runs n kinds"]:
        """Return what is recorded; see `SideBySide.predict`.

        Limits, what judges and how many runs are no padding say nothing here.
        """
        del limits, judging, runs
        count, present = len(thetas), self._fluid.present(thetas)
        eights = Eights.of(self._packed, numbers, thetas, moduli)
        is_shaped = np.any(thetas[:, self._shaping])
        shaped = (lambda eight: self._rates(eight, present, part)) if is_shaped else None
        rate = eights.rates(np.asarray(part.rate), shaped)
        found = self._states(thetas, eights, len(numbers.modulus), rate, part)
        stress, felt, of_modes = found[..., 0], found[..., 1], found[..., 2:]
        beside = []
        if normal:
            beside = [normal_stress_differences(part.kinematics, stress, of_modes)]
        if not np.any(thetas[:, self._distorting]):
            return np.concatenate([stress[..., None], *beside], axis=-1)
        places = np.split(in_whole_eights(count), len(eights.pairs))
        recorded = [
            self._recorded(eight, present, part, stress[at], felt[at])
            for (eight, _), at in zip(eights.pairs, places, strict=True)
        ]
        return np.concatenate([np.concatenate(recorded)[:count, ..., None], *beside], axis=-1)

    def _states(self, thetas, eights: Eights, declared: int, rate, part) -> np.ndarray:
        """Return stresses, felt rates and those of the modes, shape (trials, runs, n, 6)."""
        own = np.asarray(part.rate)
        # behind the last there are copies of it
        changes = np.diff(own, axis=1) != 0.0
        last = own.shape[1] - 1 - np.argmax(changes[:, ::-1], axis=1) if changes.size else 0
        last = np.where(np.any(changes, axis=1), last, 0)
        place = np.minimum(np.arange(own.shape[1]), last[:, None])
        of_run, at = np.nonzero(np.arange(own.shape[1]) <= last[:, None])
        leaves = [np.asarray(leaf) for leaf in jax.tree.leaves(part.kinematics)]
        flows = (
            np.concatenate([leaf.reshape(len(own), -1) for leaf in leaves], 1) if leaves else None
        )
        flags = self._flags.of(thetas)
        patterns, which = np.unique(flags, axis=0, return_inverse=True)
        out = np.empty((len(thetas), *own.shape, 6))

        def some(lanes: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
            pattern, trial, state = lanes
            filled = in_whole_eights(len(trial))
            trial, state = trial[filled], state[filled]
            row, column = of_run[state], at[state]

            of_mode = eights.modes[trial]
            # what effects add is left out where no lane has it
            present = np.any(of_mode[:, :, 0] != 0.0, axis=0)
            present[:declared] = True
            given = {
                "rate": lanes_last(rate[trial, row, column]),
                "shared": lanes_last(eights.shared[trial]),
                "mode": lanes_last(of_mode[:, present]),
                "flow": np.zeros(1) if flows is None else lanes_last(flows[row]),
            }
            stress, felt, of_modes = self._code(patterns[pattern[0]], given)
            found = [stress[:, None], felt[:, None], of_modes]
            found = np.moveaxis(np.concatenate(found, axis=1), 1, -1)
            out[trial, row, column] = found.reshape(-1, 6)

        pieces = []
        for number in range(len(patterns)):
            trials = np.flatnonzero(which.ravel() == number)
            trial = np.repeat(trials, len(of_run))
            state = np.tile(np.arange(len(of_run)), len(trials))
            for first in range(0, len(trial), _AT_ONCE * LANES):
                piece = slice(first, first + _AT_ONCE * LANES)
                pieces.append((np.array([number]), trial[piece], state[piece]))
        in_threads(some, pieces, is_compiled=True)
        return np.take_along_axis(out, place[None, :, :, None], axis=2)
