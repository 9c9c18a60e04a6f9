"""Transients at a given rate and sweeps of many vectors of parameters, eight side by side.

Where a vector asks for it NumPy shapes the rate and distorts the signal, of all vectors and runs
together. Each oscillation of a sweep is a run of half a cycle, which its mirror image brings back.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Float

from discover.effects import KinematicEffect, SignalEffect
from discover.forward.augmented_fluid import AugmentedFluid
from discover.forward.declared import Numbers
from discover.forward.exponential_weights import krogstad_weights
from discover.forward.flows import TransientFlows
from discover.forward.side_by_side.kernel import Kernel
from discover.forward.side_by_side.predictors import (
    Asked,
    LanePredictor,
    MadeOnce,
    StatePredictor,
    flows_of,
    in_whole_eights,
    per_run,
)
from discover.forward.side_by_side.step import WEIGHTS
from discover.programs.lanes import LANES

# Vectors of the same times from which on weights of the steps are worth a table
_MANY = 8

# Below this fraction of the run a step only marks a jump of the rate, and nothing gives way in it
JUMP = 1e-9


class _Runs(NamedTuple):
    """Runs in arrays of NumPy, and as the kernel takes them.

    `given`: by the names of its arrays, without effects of the instrument. `pieces`, `share`,
    `width`: how many pieces each step has, and how long one is, over the step and in s. `jump`:
    width up to which a step only marks a jump of the rate, in s. `cycle`, `period`: steps between
    which the cycle lies that a run's start brings back, the first negative where there is none, and
    its length in s.
    """

    flows: TransientFlows
    given: dict[str, np.ndarray]
    in_shear: bool


def _runs(part: TransientFlows) -> _Runs:
    """Return runs as the kernel takes them."""
    flows = jax.tree.map(np.asarray, part)
    times, last, cycle = flows.times[:, ::2], flows.last_step, flows.cycle.astype(np.int64)
    ends = np.take_along_axis(times, np.maximum(cycle, 0), axis=1)
    given = {
        # as commanded, where no instant at which it steps is fitted
        "rate": np.repeat(flows.commanded_rate[..., None], LANES, axis=-1),
        # one step more than its samples need, since effects of the signal look at its rate
        "last": np.minimum(last + 1, np.max(last)).astype(np.int64),
        "cycle": cycle,
        "period": np.where(cycle[:, 0] < 0, 1.0, np.diff(ends, axis=1)[:, 0]),
        "pieces": flows.pieces,
        "width": np.diff(times) / flows.pieces,
        "share": 1.0 / flows.pieces,
        "jump": JUMP * times[:, -1],
        "flow": flows_of(flows.kinematics),
    }
    flow = flows.kinematics
    return _Runs(flows, given, flow is None or bool(np.any(flow.is_shear)))


class SideBySide(LanePredictor):
    """Predictions of transients for one structure of law and effects.

    `rates`: of vectors, the effects present, and runs: the felt rate at ends and middles of steps,
    and the tool's at ends. `distorted`: of these, the stress and both rates, what would be recorded
    at ends.
    """

    def __init__(
        self,
        fluid: AugmentedFluid,
        code: Kernel,
        rates: Callable,
        distorted: Callable,
    ):
        super().__init__(fluid, code)
        self._rates, self._distorted = rates, distorted
        effects, still = fluid.structure.effects, KinematicEffect.felt_rate
        shaping = [e for e in effects if isinstance(e, KinematicEffect)]
        shaping = [e for e in shaping if type(e).felt_rate is not still]
        distorting = [e for e in effects if isinstance(e, SignalEffect)]
        self._shaping, self._distorting = map(self._amplitudes, (shaping, distorting))
        self._runs = MadeOnce(_runs)
        self._known_table: tuple | None = None

    def predict(self, asked: Asked) -> Float[np.ndarray, "trials runs n kinds"]:
        """Return what is recorded, see `Asked.whole`."""
        times, counts = np.unique(asked.thetas[:, 1], return_counts=True)
        most = int(np.argmax(counts))
        table = self._table(asked.numbers, asked.part, float(times[most]), int(counts[most]))
        laid_out, packed = self._runs(asked.part), self._packed(*asked[:3])

        def eight(lanes: np.ndarray, used: np.ndarray) -> np.ndarray:
            of_lanes = packed.of_eight(lanes, asked.declared)
            return self._eight(asked.taken(lanes), laid_out, used, table, of_lanes)

        return self._by_eights(asked.thetas, [asked.thetas[:, 1]], eight)

    def _eight(
        self,
        asked: Asked,
        laid_out: _Runs,
        used: np.ndarray,
        table: tuple[float, Any],
        packed: dict[str, np.ndarray],
    ) -> np.ndarray:
        """Return what is recorded of eight vectors, shape (lanes, runs, n, kinds)."""
        thetas, declared = asked.thetas, asked.declared
        flows, given, in_shear = laid_out
        given, tool_rate = given | packed, flows.commanded_rate[:, ::2]
        columns, present = per_run(thetas), self._fluid.present(thetas)
        if flows.steps is not None or (in_shear and np.any(thetas[:, self._shaping])):
            rate, tool_rate = self._rates(columns, present, flows)
            rate = np.broadcast_to(rate, (LANES, *rate.shape[-2:]))
            given["rate"] = np.ascontiguousarray(np.moveaxis(rate, 0, -1))
        time, given["table"] = table
        if given["table"] is None or np.any(thetas[:, 1] != time):
            given["table"], declared = np.zeros(WEIGHTS), 0
        stress, felt, of_modes = self._code(declared, used, given, asked.whole)
        places = np.arange(len(stress))[:, None], flows.sample_index
        at_samples, beside = stress[places], []
        if asked.whole:
            own = (at_samples[:, :, None], of_modes[places])
            beside = [np.moveaxis(of, -1, 0) for of in own]
        if not (in_shear and np.any(thetas[:, self._distorting])):
            return np.concatenate([np.moveaxis(at_samples, -1, 0)[..., None], *beside], axis=-1)
        beyond = np.arange(stress.shape[1]) > given["last"][:, None]
        felt[beyond], stress[beyond] = given["rate"][:, ::2][beyond], 0.0
        signals = (np.moveaxis(of, -1, 0) for of in (stress, felt))
        with np.errstate(all="ignore"):  # of a vector that runs away
            found = self._distorted(columns, present, flows, *signals, tool_rate)
        return np.concatenate([found[:, *places][..., None], *beside], axis=-1)

    def _table(
        self, numbers: Numbers, part: TransientFlows, time: float, count: int
    ) -> tuple[float, np.ndarray | None]:
        """Return the weights of the steps for trials of the same times, and what tells these."""
        known, own = self._known_table, numbers.relaxation_time
        if known is not None and known[0] is own and known[1] is part and known[2] == time:
            return time, known[3]
        # those of chains that retract depend on more than the times
        if numbers.law.retracts or (count < _MANY and time != 0.0):
            return time, None
        width = self._runs(part).given["width"]
        h = width[..., None] / (np.asarray(own) * np.exp(time))
        weights = krogstad_weights(-float(numbers.law.linear_relaxation) * h, h)
        found = np.stack(weights[:WEIGHTS], axis=-1)
        self._known_table = own, part, time, found
        return time, found


# Of the secant most steps, the relative change of the strain that ends it, and its bounds
_MOST_SECANTS, _TOLERANCE, _SECANT = 40, 1e-8, (0.2, 5.0)


class PeriodicSideBySide(StatePredictor):
    """Predictions of moduli for one structure of law and effects.

    `code`: of transients that begin with a cycle, of which each state is one. `rates`: as of
    `StatePredictor`. `given_way`, `recorded`: of a vector, states, felt strains and moduli of the
    modes: by how much the tool turns further than the fluid; and with the felt rates, what is
    recorded.
    """

    def __init__(
        self,
        fluid: AugmentedFluid,
        code: Kernel,
        rates: Callable,
        given_way: Callable,
        recorded: Callable,
    ):
        super().__init__(fluid, code, rates)
        self._series = self._amplitudes(fluid.series)
        others = self._amplitudes(e for e in fluid.states if not e.acts_on_steady_states)
        self._still = [*others, *self._series]

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
        """Return the complex moduli of the modes, shape (trials, states), each state a run."""
        part, steps = asked.part, asked.part.steps.astype(np.int64)
        frequency, most = part.frequency, int(np.max(steps))
        thetas = asked.thetas.copy()
        thetas[:, self._still] = 0.0
        width = np.repeat((np.pi / (frequency * steps))[:, None], most, axis=1)
        phase = np.arange(2 * most + 1) * (0.5 * np.pi / steps[:, None])
        wave = frequency[:, None] * np.cos(phase)
        # of what is periodic the sum over a period is exact to all orders, and over half of it here
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
            _, _, of_modes = self._code(0, used, given, normal=True, mirrored=True)
            stress = np.where(ends[:, :, None], of_modes[:, 1:, 3], 0.0)
            return (np.sum(harmonic[:, :, None] * stress, axis=1) / amplitude).T

        return self._by_eights(thetas, (), eight)
