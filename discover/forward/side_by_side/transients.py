"""Transients at a given rate of many vectors of parameters, eight side by side.

Vectors that need the same parts of the kernel go together, for what one of eight needs is computed
for all of them. The rate that an instrument shapes and the signal that it distorts are left to JAX,
which is called only where a vector asks for it.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from discover.effects import KinematicEffect, SignalEffect
from discover.forward.augmented_fluid import AugmentedFluid
from discover.forward.batches import Records, TransientFlows
from discover.forward.dynamics import declared_weights
from discover.forward.integrators.with_effects import JUMP
from discover.forward.side_by_side.kernel import Kernel
from discover.forward.side_by_side.step import WEIGHTS, laid_out
from discover.forward.structure import Numbers
from discover.programs import compiled, in_threads
from discover.programs.lanes import LANES

# Vectors of the same times from which on weights of the steps are worth a table
_MANY = 8

# Of the runs that were laid out for the kernel
_KEPT = 8

_OF_RUNS = ("last", "width", "jump", "flow", "weight", "recorded")


class _Runs(NamedTuple):
    """Runs as the kernel takes them, in arrays of NumPy.

    Attributes
    ----------
    last
        How many steps of each are taken.
    width, jump
        Of the steps, and the width up to which one only marks a jump of the rate, in s.
    flow
        Kinematics of each run.
    sample
        Positions of the samples among step ends.
    weight, recorded
        What was measured, at step ends.
    rate, tool_rate
        Without effects of the instrument, with the lanes first.
    in_lanes
        The rate with the lanes last.
    """

    last: np.ndarray
    width: np.ndarray
    jump: np.ndarray
    flow: np.ndarray
    sample: np.ndarray
    weight: np.ndarray
    recorded: np.ndarray
    rate: np.ndarray
    tool_rate: np.ndarray
    in_lanes: np.ndarray


class SideBySide:
    """Predictions of transients for one structure of law and effects.

    Parameters
    ----------
    fluid, kernel
        The fluid with its effects, and its machine code.
    rates
        Of a vector and a run, the felt rate at ends and middles of steps, without what series
        elements take, and the tool's rate at ends.
    recorded
        Of a vector, a run, the stress, the felt rate and the tool's, what is recorded at samples.
    made_from
        What tells these from those of another structure.
    """

    def __init__(
        self,
        fluid: AugmentedFluid,
        kernel: Kernel,
        rates: Callable,
        recorded: Callable,
        made_from: tuple,
    ):
        self._kernel = kernel
        effects, at = fluid.structure.effects, fluid.slices
        still = KinematicEffect.felt_rate
        shaping = [
            e for e in effects if isinstance(e, KinematicEffect) and type(e).felt_rate is not still
        ]
        self._shaping = [at[e.name].start for e in shaping]
        self._fits_instants = fluid.instants.stop > fluid.instants.start
        self._distorting = [at[e.name].start for e in effects if isinstance(e, SignalEffect)]

        def packed(numbers: Numbers, thetas):
            def one(theta):
                of_mode, shared = laid_out(fluid, numbers, theta)
                return kernel.packed(of_mode, True), kernel.packed(shared, False)

            return jax.vmap(one, out_axes=-1)(thetas)

        self._packed = compiled(packed, made_from=("packed", *made_from))
        over_runs = jax.vmap(rates, in_axes=(None, 0))
        self._rates = compiled(jax.vmap(over_runs, in_axes=(0, None)), ("rates", *made_from))
        of_runs = jax.vmap(recorded, in_axes=(None, 0, 0, 0, 0))
        of_trials = jax.vmap(of_runs, in_axes=(0, None, 0, 0, 0))
        self._recorded = compiled(of_trials, ("recorded", *made_from))
        self._known_runs: list[tuple[TransientFlows, Records, _Runs]] = []
        self._known_table: tuple | None = None

    def predict(
        self,
        numbers: Numbers,
        thetas: Float[np.ndarray, "trials p"],
        part: TransientFlows,
        judging: Records,
        runs: int,
        limits: Float[np.ndarray, " trials"],
    ) -> Float[np.ndarray, "trials runs n"]:
        """Return what is recorded of the first runs.

        Parameters
        ----------
        part, judging
            Runs, and what was recorded of them.
        runs
            How many are asked for; those behind are padding.
        limits
            Sums of squared residuals from which on a vector is of no use. Infinity follows it to
            the end.
        """
        flags = self._kernel.flags.of(thetas)
        order = np.lexsort([thetas[:, 1], *flags.T])
        laid_out = self._runs(part, judging, thetas[0])
        times, counts = np.unique(thetas[:, 1], return_counts=True)
        table = self._table(numbers, part, float(times[np.argmax(counts)]), int(np.max(counts)))
        out = np.empty((len(thetas), runs, laid_out.sample.shape[1]))

        def eight(trials: np.ndarray) -> None:
            lanes = trials[np.minimum(np.arange(LANES), len(trials) - 1)]
            limit = np.where(np.arange(LANES) < len(trials), limits[lanes], -np.inf)
            used = np.any(flags[trials], axis=0)
            found = self._eight(numbers, thetas[lanes], part, laid_out, runs, used, table, limit)
            out[trials] = np.moveaxis(found, -1, 0)[: len(trials)]

        # to compile is behind a lock, so that no first call is needed alone
        in_threads(eight, np.split(order, range(LANES, len(order), LANES)), is_compiled=True)
        return out

    def _eight(
        self,
        numbers: Numbers,
        thetas: np.ndarray,
        part: TransientFlows,
        laid_out: _Runs,
        runs: int,
        used: np.ndarray,
        table: tuple[float, np.ndarray | None],
        limit: np.ndarray,
    ) -> np.ndarray:
        """Return what is recorded of eight vectors, shape (runs, n, lanes)."""
        modes, shared = (np.asarray(array) for array in self._packed(numbers, thetas))
        declared = len(numbers.modulus)
        if len(modes) > declared:
            # what effects add is left out where none of the eight has it
            absent = np.all(modes[:, 0] == 0.0, axis=-1) & (np.arange(len(modes)) >= declared)
            modes = np.ascontiguousarray(modes[~absent])
        rate, tool_rate, in_lanes = laid_out.rate, laid_out.tool_rate, laid_out.in_lanes
        if self._fits_instants or np.any(thetas[:, self._shaping]):
            rate, tool_rate = (np.asarray(array) for array in self._rates(thetas, part))
            in_lanes = np.ascontiguousarray(np.moveaxis(rate, 0, -1))
        time, tabled = table
        if tabled is None or np.any(thetas[:, 1] != time):
            tabled, declared = np.zeros(WEIGHTS), 0
        stress, felt, goes_on = self._kernel(
            runs,
            declared,
            used,
            {"rate": in_lanes, "shared": shared, "mode": modes, "limit": limit, "table": tabled}
            | {name: getattr(laid_out, name) for name in _OF_RUNS},
        )
        if not goes_on:
            stress[:] = np.nan
        rows = np.arange(runs)[:, None]
        if not np.any(thetas[:, self._distorting]):
            return stress[rows, laid_out.sample[:runs]]
        beyond = (np.arange(stress.shape[1]) > laid_out.last[:, None])[..., None]
        felt = np.where(beyond, in_lanes[:, ::2], felt)
        stress = np.where(beyond, 0.0, stress)
        first = (np.moveaxis(array, -1, 0) for array in (stress, felt))
        found = np.asarray(self._recorded(thetas, part, *first, tool_rate))
        return np.moveaxis(found, 0, -1)[:runs]

    def _runs(self, part: TransientFlows, judging: Records, theta: np.ndarray) -> _Runs:
        """Return runs as the kernel takes them, laid out once."""
        for known, by, found in self._known_runs:
            if known is part and by is judging:
                return found
        plain = np.tile(theta, (LANES, 1))
        plain[:, self._shaping] = 0.0
        rate, tool_rate = (np.asarray(array) for array in self._rates(plain, part))
        times, sample = np.asarray(part.times)[:, ::2], np.asarray(part.sample_index)
        weight, recorded = np.zeros(times.shape), np.zeros(times.shape)
        places = (np.arange(len(times))[:, None], sample)
        np.add.at(weight, places, np.asarray(judging.weight))
        np.add.at(recorded, places, np.asarray(judging.recorded))
        last = np.asarray(part.last_step)
        found = _Runs(
            # one step more than its samples need, since effects of the signal look at its rate
            np.minimum(last + 1, np.max(last)).astype(np.int64),
            np.diff(times),
            JUMP * times[:, -1],
            self._kernel.flows(part.kinematics),
            sample,
            weight,
            recorded,
            rate,
            tool_rate,
            np.ascontiguousarray(np.moveaxis(rate, 0, -1)),
        )
        self._known_runs.append((part, judging, found))
        del self._known_runs[:-_KEPT]
        return found

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
        times = np.asarray(own) * np.exp(time)
        decay = jnp.asarray(float(numbers.law.linear_relaxation))
        weights = np.asarray(declared_weights(part.times, jnp.asarray(times), decay))
        found = np.ascontiguousarray(np.swapaxes(weights[:, :, 0, :WEIGHTS], 2, 3))
        self._known_table = own, part, time, found
        return time, found
