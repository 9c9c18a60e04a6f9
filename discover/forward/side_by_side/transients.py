"""Transients at a given rate of many vectors of parameters, eight side by side.

Vectors that need the same parts of the kernel go together, for what one of eight needs is computed
for all of them. The rate that an instrument shapes and the signal that it distorts are left to JAX,
which is called only where a vector asks for it.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from discover.effects import KinematicEffect, SignalEffect
from discover.forward.augmented_fluid import AugmentedFluid
from discover.forward.batches import Records, TransientFlows
from discover.forward.declared import Numbers
from discover.forward.dynamics import declared_weights
from discover.forward.integrators.stepping import JUMP
from discover.forward.side_by_side.kernel import Kernel
from discover.forward.side_by_side.step import WEIGHTS, Flags
from discover.programs import compiled, in_threads
from discover.programs.lanes import LANES
from discover.protocols.kinematics import normal_stress_differences

# Vectors of the same times from which on weights of the steps are worth a table
_MANY = 8

# Of the runs that were laid out for the kernel
_KEPT = 8

# Steps of the grid from which on vectors choose their own, and as how many of them a step may
# always be long: two halves, extrapolated, err no more than two steps of the grid
_FEWEST, _ALWAYS = 8, 2.0

_OF_RUNS = (
    "last", "held", "cycle", "width", "whole", "least", "period", "jump", "flow", "weight",
    "recorded",
)  # fmt: skip


class _Runs(NamedTuple):
    """Runs as the kernel takes them, in arrays of NumPy.

    `width`, `jump`: of the steps, and the width up to which one only marks a jump of the rate, in
        s.
    `held`, `whole`, `least`: of how many steps that follow the commanded rate may be a straight
        line, from each on, how long these are together, in s, and how short a vector's own may
        become; see `OwnWidths`.
    `cycle`, `period`: steps between which the cycle lies that a run's start brings back, the first
        negative where there is none, and how long it is, in s.
    `weight`, `recorded`: what was measured, at step ends.
    `rate`, `tool_rate`: without effects of the instrument, with the lanes first.
    `in_shear`: whether any of them is simple shear, where alone an instrument shapes and distorts.
    """

    last: np.ndarray  # how many steps of each are taken
    cycle: np.ndarray
    period: np.ndarray
    held: np.ndarray
    width: np.ndarray
    whole: np.ndarray
    least: np.ndarray
    jump: np.ndarray
    flow: np.ndarray  # kinematics of each run
    sample: np.ndarray  # positions of the samples among step ends
    weight: np.ndarray
    recorded: np.ndarray
    rate: np.ndarray
    tool_rate: np.ndarray
    in_lanes: np.ndarray  # the rate with the lanes last
    in_shear: bool


def intervals(part: TransientFlows) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return of each step how many from it on are one interval, its length, and the least step.

    An interval ends at a sample and where a rate jumps. One of few steps is left as it is, and so
    is one in which the commanded rate is no straight line.
    """
    half, rates = np.asarray(part.times), np.asarray(part.commanded_rate)
    times, sample, last = half[:, ::2], np.asarray(part.sample_index), np.asarray(part.last_step)
    jump = JUMP * times[:, -1]
    width = np.diff(times)
    held = np.ones(width.shape, np.int64)
    whole, least = width.copy(), width.copy()
    behind = np.asarray(part.cycle)[:, 1]
    for row, (own, at) in enumerate(zip(times, sample, strict=True)):
        jumps = np.flatnonzero(width[row] <= jump[row])
        starts = np.searchsorted(own, 0.0)
        ends = np.unique(np.concatenate([[0, starts], at, jumps, jumps + 1]))
        ends = ends[ends <= last[row]]
        for first, end in pairwise(ends):
            # a cycle is gone through in the same steps again and again
            if end - first < _FEWEST or first < behind[row]:
                continue
            own_rates, own_times = (of[row, 2 * first : 2 * end + 1] for of in (rates, half))
            line = np.interp(own_times, own_times[[0, -1]], own_rates[[0, -1]])
            if np.all(np.abs(own_rates - line) <= 1e-10 * np.abs(line)):
                length = own[end] - own[first]
                held[row, first], whole[row, first] = end - first, length
                least[row, first] = _ALWAYS * length / (end - first)
    return held, whole, least


def _between(
    values: Float[np.ndarray, "runs n lanes"], part: TransientFlows
) -> Float[np.ndarray, "runs s lanes"]:
    """Return values at samples as straight lines between these, at all step ends."""
    times, sample = np.asarray(part.times)[:, ::2], np.asarray(part.sample_index)
    return np.array(
        [
            np.stack([np.interp(own, own[at], one) for one in of_run.T], axis=-1)
            for of_run, own, at in zip(values, times, sample, strict=False)
        ]
    )


class SideBySide:
    """Predictions of transients for one structure of law and effects.

    `fluid`, `kernel`: the fluid with its effects, and its machine code. `rates`: of a vector, the
    effects that are present, and a run: the felt rate at ends and middles of steps, without what
    series elements take, and the tool's rate at ends. `recorded`: of these, the stress, the felt
    rate and the tool's, what is recorded at samples. `made_from`: what tells these from those of
    another structure.
    """

    def __init__(
        self,
        fluid: AugmentedFluid,
        kernel: Kernel,
        rates: Callable,
        recorded: Callable,
        made_from: tuple,
    ):
        self._fluid, self._kernel, self._flags = fluid, kernel, Flags(fluid)
        effects, at = fluid.structure.effects, fluid.slices
        still = KinematicEffect.felt_rate
        shaping = [
            e for e in effects if isinstance(e, KinematicEffect) and type(e).felt_rate is not still
        ]
        self._shaping = [at[e.name].start for e in shaping]
        self._distorting = [at[e.name].start for e in effects if isinstance(e, SignalEffect)]

        self._packed = kernel.packing(fluid, made_from, -1)
        over_runs = jax.vmap(rates, in_axes=(None, None, 0))
        of_trials = jax.vmap(over_runs, in_axes=(0, None, None))
        self._rates = compiled(of_trials, ("rates", *made_from))
        of_runs = jax.vmap(recorded, in_axes=(None, None, 0, 0, 0, 0))
        of_trials = jax.vmap(of_runs, in_axes=(0, None, None, 0, 0, 0))
        self._recorded = compiled(of_trials, ("recorded", *made_from))
        self._known_runs: list[tuple[TransientFlows, Records, _Runs]] = []
        self._known_table: tuple | None = None

    def predict(
        self,
        numbers: Numbers,
        thetas: Float[np.ndarray, "trials p"],
        moduli: Float[np.ndarray, "trials c"],
        limits: Float[np.ndarray, " trials"],
        part: TransientFlows,
        judging: Records,
        runs: int,
        normal: bool,
    ) -> Float[np.ndarray, "trials runs n kinds"]:
        """Return what is recorded of the first runs, and N1 and N2 behind it if asked for.

        `moduli`: of the declared modes in Pa, and behind them the viscosity of the solvent in Pa s.
        `limits`: sums of squared residuals from which on a vector is of no use. Infinity follows it
        to the end. `part`, `judging`: runs, and what was recorded of them. `runs`: how many are
        asked for; those behind are padding. `normal`: whether N1 and N2 are.
        """
        flags = self._flags.of(thetas)
        order = np.lexsort([thetas[:, 1], *flags.T])
        laid_out = self._runs(part, judging)
        times, counts = np.unique(thetas[:, 1], return_counts=True)
        table = self._table(numbers, part, float(times[np.argmax(counts)]), int(np.max(counts)))
        out = np.empty((len(thetas), runs, laid_out.sample.shape[1], 3 if normal else 1))

        def eight(trials: np.ndarray) -> None:
            lanes = trials[np.minimum(np.arange(LANES), len(trials) - 1)]
            limit = np.where(np.arange(LANES) < len(trials), limits[lanes], -np.inf)
            used = np.any(flags[trials], axis=0)
            each = thetas[lanes], moduli[lanes], limit
            found = self._eight(numbers, *each, part, laid_out, runs, used, table, normal)
            out[trials] = found[: len(trials)]

        # to compile is behind a lock, so that no first call is needed alone
        in_threads(eight, np.split(order, range(LANES, len(order), LANES)), is_compiled=True)
        return out

    def _eight(
        self,
        numbers: Numbers,
        thetas: np.ndarray,
        moduli: np.ndarray,
        limit: np.ndarray,
        part: TransientFlows,
        laid_out: _Runs,
        runs: int,
        used: np.ndarray,
        table: tuple[float, np.ndarray | None],
        normal: bool,
    ) -> np.ndarray:
        """Return what is recorded of eight vectors, shape (lanes, runs, n, kinds)."""
        modes, shared = (np.asarray(array) for array in self._packed(numbers, thetas, moduli))
        declared = len(numbers.modulus)
        if len(modes) > declared:
            # what effects add is left out where none of the eight has it
            absent = np.all(modes[:, 0] == 0.0, axis=-1) & (np.arange(len(modes)) >= declared)
            modes = np.ascontiguousarray(modes[~absent])
        rate, tool_rate, in_lanes = laid_out.rate, laid_out.tool_rate, laid_out.in_lanes
        present = self._fluid.present(thetas)
        is_shaped = laid_out.in_shear and np.any(thetas[:, self._shaping])
        if part.steps is not None or is_shaped:
            rate, tool_rate = (np.asarray(array) for array in self._rates(thetas, present, part))
            in_lanes = np.ascontiguousarray(np.moveaxis(rate, 0, -1))
        time, tabled = table
        if tabled is None or np.any(thetas[:, 1] != time):
            tabled, declared = np.zeros(WEIGHTS), 0
        given = {"rate": in_lanes, "shared": shared, "mode": modes, "limit": limit, "table": tabled}
        given |= {name: getattr(laid_out, name) for name in _OF_RUNS}
        stress, felt, of_modes, goes_on = self._kernel(runs, declared, used, given, normal)
        if not goes_on:
            stress[:] = np.nan
        places = np.arange(runs)[:, None], laid_out.sample[:runs]
        at_samples, beside = stress[places], []
        if normal:
            flow = jax.tree.map(lambda leaf: leaf[:runs], part.kinematics)
            own = (np.moveaxis(of, -1, 0) for of in (at_samples, of_modes[places]))
            beside = [normal_stress_differences(flow, *own)]
        if not (laid_out.in_shear and np.any(thetas[:, self._distorting])):
            return np.concatenate([np.moveaxis(at_samples, -1, 0)[..., None], *beside], axis=-1)
        if np.any(laid_out.held > 1):
            # what alters a signal looks beyond its samples, at all steps of the grid
            given["held"] = np.ones_like(laid_out.held)
            stress, felt, *_ = self._kernel(runs, declared, used, given)
            stress[:runs] += _between(at_samples - stress[places], part)
        beyond = (np.arange(stress.shape[1]) > laid_out.last[:, None])[..., None]
        felt = np.where(beyond, in_lanes[:, ::2], felt)
        stress = np.where(beyond, 0.0, stress)
        first = (np.moveaxis(array, -1, 0) for array in (stress, felt))
        found = np.asarray(self._recorded(thetas, present, part, *first, tool_rate))
        return np.concatenate([found[:, :runs, :, None], *beside], axis=-1)

    def _runs(self, part: TransientFlows, judging: Records) -> _Runs:
        """Return runs as the kernel takes them, laid out once."""
        for known, by, found in self._known_runs:
            if known is part and by is judging:
                return found
        # as commanded, where no instant at which it steps is fitted
        rate = np.tile(np.asarray(part.commanded_rate), (LANES, 1, 1))
        tool_rate = np.ascontiguousarray(rate[:, :, ::2])
        times, sample = np.asarray(part.times)[:, ::2], np.asarray(part.sample_index)
        weight, recorded = np.zeros(times.shape), np.zeros(times.shape)
        places = (np.arange(len(times))[:, None], sample)
        np.add.at(weight, places, np.asarray(judging.weight))
        np.add.at(recorded, places, np.asarray(judging.recorded))
        last = np.asarray(part.last_step)
        held, whole, least = intervals(part)
        flow = part.kinematics
        cycle = np.asarray(part.cycle).astype(np.int64)
        ends = np.take_along_axis(times, np.maximum(cycle, 0), axis=1)
        found = _Runs(
            # one step more than its samples need, since effects of the signal look at its rate
            np.minimum(last + 1, np.max(last)).astype(np.int64),
            cycle,
            np.where(cycle[:, 0] < 0, 1.0, np.diff(ends, axis=1)[:, 0]),
            held,
            np.diff(times),
            whole,
            least,
            JUMP * times[:, -1],
            self._kernel.flows(part.kinematics),
            sample,
            weight,
            recorded,
            rate,
            tool_rate,
            np.ascontiguousarray(np.moveaxis(rate, 0, -1)),
            flow is None or bool(np.any(np.asarray(flow.gradient)[:, 3] == 1.0)),
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
