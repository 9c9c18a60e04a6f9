"""Flow curves of many vectors of parameters: every steady state is a lane of its own."""

from collections.abc import Callable, Iterator

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from discover.effects import SignalEffect
from discover.forward.augmented_fluid import AugmentedFluid, where_in_shear
from discover.forward.flows import SteadyFlows
from discover.forward.side_by_side.code import Code, lanes_last
from discover.forward.side_by_side.predictors import (
    Asked,
    StatePredictor,
    flows_of,
    in_whole_eights,
    per_run,
)
from discover.forward.side_by_side.step import Mode, Shared, Step, _if
from discover.forward.steady_states import (
    MOST_STEPS,
    Approach,
    approach_step,
    are_still,
    arrived,
    moves,
)
from discover.programs import in_threads
from discover.programs.lanes import LANES
from discover.programs.lanes.arithmetic import INTEGER
from discover.protocols.kinematics import Kinematics
from tensor_library.algebra import contracted

_COUNTS = ("groups", "modes")
_WIDE = ("rate", "shared", "mode", "flow", "stress", "felt", "of_modes", "scratch")
_WHOLE = ("flags", "goes_on")
_ARRAYS = (*_WIDE, *_WHOLE)

# Where in the scratch array what stands that is carried from step to step; of each mode its state,
# and behind that the number of its next step and how many were taken again
_FELT, _INDEX, _ALIVE, _SUM, _MOVING = range(5)
_TOTAL = 5


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
        """Return a mode in Pa; not a number where it is not steady."""
        slow = self._factor("time_factor", shared, on, levels)
        change, weissenberg = self._of_way(shared, mode, on, flow, slow, felt, rate)
        end = arrived(change, Approach(way[:-2, None], way[-2:-1], way[-1:]), weissenberg)
        return mode.modulus * end[:, 0]

    def recorded(self, shared, on, flow, levels, felt, of_modes):
        """Return the recorded stress with what stands beside the modes, and that of all modes."""
        of_modes = self._factor("modulus_factor", shared, on, levels) * of_modes
        recorded = of_modes[3] if flow is None else contracted(flow.recorded, of_modes[:4])
        return recorded + self.beside(shared, on, flow, felt), of_modes


class SteadyCode(Code):
    """Machine code for steady states."""

    counts, arrays, wide, whole = _COUNTS, _ARRAYS, _WIDE, _WHOLE

    def __init__(self, fluid: AugmentedFluid, found: tuple[Mode, Shared], flow: Kinematics | None):
        super().__init__(fluid, found, flow)
        # of a mode, and the two numbers of its way
        self._numbers = self.size + 2
        states = [effect for effect in fluid.states if effect.acts_on_steady_states]
        self._step = SteadyStep(fluid, self._plain_law, states)
        self._levels = [(effect.levels, effect.rest) for effect in states]
        self._levels_at = _TOTAL + self.size
        self._modes_at = self._levels_at + sum(levels for levels, _ in self._levels)
        self._make(fluid, found, flow)

    def __call__(self, used: np.ndarray, given: dict[str, np.ndarray]) -> tuple[np.ndarray, ...]:
        """Return recorded stress before the signal, felt rate, and the modes' stress.

        The first two have the shape (groups, lanes), the last is σ11, σ22, σ33, σ12 and structure
        variables, shape (groups, s, lanes). `given`: rates, modes, what these share, and flows,
        groups first and lanes last.
        """
        groups, modes = given["mode"].shape[:2]
        stress, felt = np.empty((2, groups, LANES))
        of_modes = np.empty((groups, self.size, LANES))
        arrays = given | {
            "flags": used.astype(np.int64), "stress": stress, "felt": felt, "of_modes": of_modes,
            "scratch": np.empty((self._modes_at + modes * self._numbers, LANES)),
            "goes_on": np.ones(1, np.int64),
        }  # fmt: skip
        self._run((groups, modes), arrays)
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
        self._rest(self._levels, self._levels_at)
        with w.loop(w.at((modes, self._numbers))) as number:
            self._keep(0.0, w.at((number, 1), (self._modes_at, 1)))
        w.store(INTEGER(1), "goes_on", 0)
        with w.loop(MOST_STEPS, self._goes_on), a.apart():
            levels = self._states(self._levels, self._levels_at)
            felt, index, alive = (self._kept(place) for place in (_FELT, _INDEX, _ALIVE))
            self._keep(np.zeros(2), _SUM)
            with w.loop(modes) as number, a.apart():
                mode, way, at = self._mode(group, number)
                after, moving, sheared = write(
                    step.onward, shared, mode, on, flow, levels, felt, rate, index, alive, way
                )
                self._keep(after, at)
                self._keep(a.larger(self._kept(_MOVING), moving[()]), _MOVING)
                self._keep(a.add(self._kept(_SUM), sheared[()]), _SUM)
            felt, after, moving = write(
                step.beside_modes, shared, on, flow, levels, felt, rate, self._kept(_SUM), alive
            )
            self._keep(felt, _FELT)
            self._keep_states(after, self._levels_at)
            alive = a.multiply(alive, a.larger(self._kept(_MOVING), moving[()]))
            self._keep(alive, _ALIVE)
            self._keep(a.add(index, 1.0), _INDEX)
            self._go_on_if(a.compare(">", alive, 0.0))
        levels, felt = self._states(self._levels, self._levels_at), self._kept(_FELT)
        self._keep(np.zeros(self.size), _TOTAL)
        with w.loop(modes) as number, a.apart():
            mode, way, _ = self._mode(group, number)
            found = write(step.reached, shared, mode, on, flow, levels, felt, rate, way)
            for place, value in enumerate(found, _TOTAL):
                self._keep(a.add(self._kept(place), value), place)
        total = self._kept(_TOTAL, self.size)
        stress, of_modes = write(step.recorded, shared, on, flow, levels, felt, total)
        w.store(a.lanes(stress[()]), "stress", group)
        for i, value in enumerate(of_modes):
            w.store(a.lanes(value), "of_modes", w.at((group, self.size), (i, 1)))
        w.store(felt, "felt", group)

    def _mode(self, group, number):
        """Return a mode, its way so far and where that is kept."""
        w, modes = self._w, self._w.counts["modes"]
        mode = self._tree("mode", self._of_mode, w.at((group, modes), (number, 1)))
        at = w.at((number, self._numbers), (self._modes_at, 1))
        return mode, self._kept(at, self._numbers), at


# Eights of states that one call of the code takes
_AT_ONCE = 8


class SteadySideBySide(StatePredictor):
    """Predictions of flow curves for one structure of law and effects.

    `recorded`: of vectors, the effects present, runs, their stress and felt rate: what is recorded.
    """

    def __init__(
        self,
        fluid: AugmentedFluid,
        code: SteadyCode,
        rates: Callable,
        recorded: Callable,
    ):
        super().__init__(fluid, code, rates)
        self._distorting = self._amplitudes(e for e in self._acting if isinstance(e, SignalEffect))
        self._recorded = recorded

    def predict(self, asked: Asked) -> Float[np.ndarray, "trials runs n kinds"]:
        """Return what is recorded, see `Asked.whole`."""
        thetas, part = asked.thetas, jax.tree.map(np.asarray, asked.part)
        found = self._states(asked, self._felt(asked, part.rate, part.kinematics), part)
        stress, felt, of_modes = found[..., 0], found[..., 1], found[..., 2:]
        beside = [stress[..., None], of_modes] if asked.whole else []
        if np.any(thetas[:, self._distorting]):
            present = self._fluid.present(thetas)
            stress = self._recorded(per_run(thetas), present, part, stress, felt)
        return np.concatenate([stress[..., None], *beside], axis=-1)

    def _states(self, asked: Asked, rate: np.ndarray, part: SteadyFlows) -> np.ndarray:
        """Return stresses, felt rates and the modes', shape (trials, runs, n, 2 + s)."""
        own, packed = part.rate, self._packed(*asked[:3])
        # behind the last there are copies of it
        changes = np.diff(own, axis=1) != 0.0
        last = own.shape[1] - 1 - np.argmax(changes[:, ::-1], axis=1) if changes.size else 0
        last = np.where(np.any(changes, axis=1), last, 0)
        place = np.minimum(np.arange(own.shape[1]), last[:, None])
        of_run, at = np.nonzero(np.arange(own.shape[1]) <= last[:, None])
        flows = flows_of(part.kinematics)
        out = np.empty((len(rate), *own.shape, 2 + self._code.size))

        def solve(piece: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
            used, trial, state = piece
            row, column = of_run[state], at[state]
            given = packed.of_lanes(trial, asked.declared) | {
                "rate": lanes_last(rate[trial, row, column]),
                "flow": lanes_last(flows[row]) if part.kinematics is not None else flows,
            }
            stress, felt, of_modes = self._code(used, given)
            found = np.concatenate([stress[:, None], felt[:, None], of_modes], axis=1)
            out[trial, row, column] = np.moveaxis(found, 1, -1).reshape(-1, out.shape[-1])

        in_threads(solve, self._pieces(asked.thetas, len(of_run)), is_compiled=True)
        return np.take_along_axis(out, place[None, :, :, None], axis=2)

    def _pieces(
        self, thetas: Float[np.ndarray, "trials p"], states: int
    ) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Yield vectors and states of lanes, and the parts of the code that those need alike."""
        patterns, which = np.unique(self._flags.of(thetas), axis=0, return_inverse=True)
        size = _AT_ONCE * LANES
        for number, pattern in enumerate(patterns):
            trials = np.flatnonzero(which.ravel() == number)
            trial, state = np.repeat(trials, states), np.tile(np.arange(states), len(trials))
            for first in range(0, len(trial), size):
                some = first + in_whole_eights(min(size, len(trial) - first))
                yield pattern, trial[some], state[some]
