"""Transients at a given rate of many vectors of parameters, eight side by side.

Where a vector asks for it NumPy shapes the rate and distorts the signal, of all vectors and runs
together.
"""

from collections.abc import Callable
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
    flows_of,
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
