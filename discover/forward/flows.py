"""Runs laid out for prediction: what is needed to follow those of each control, side by side."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Float, Int

from discover.dataset import Run
from discover.forward.grid import cut, make_grid, steps_of_half_cycle, stress_grid
from discover.protocols.kinematics import MODULI, Kinematics, stack_kinematics
from discover.protocols.protocol import shear_rates

# An instrument effect acts within the first samples, so the first gap is divided this often
_EARLY_STEPS = 0.5 ** np.arange(6)

# Runs of more steps than this go on in steps that grow while the rate is constant: most of so long
# a run is steady. Shorter ones keep the accuracy of small steps throughout
_LONG, _GROWTH = 2000, 0.05

# Steps in a row that are pieces of fewer: how many at least, into how many of one length they go,
# how far their widths may differ for rounding, and rates from a straight line
_MANY_IN_A_ROW, _SHARES, _ALIKE, _STRAIGHT = 8, 4, 1e-6, 1e-10

# Time in s of steps of the rate that pad a run which has fewer
_NEVER = -1.0


class RateSteps(eqx.Module):
    """Steps of the rate between two samples, with a leading axis of runs.

    `start`, `end`: times of the samples in s; padding lies before any record. `share`: of the
    interval at whose end the rate steps, where not fitted. `place`: of its fitted share; −1 where
    not fitted.
    """

    start: Float[np.ndarray, "*runs steps"]
    end: Float[np.ndarray, "*runs steps"]
    change: Float[np.ndarray, "*runs steps"]  # of the rate in 1/s
    share: Float[np.ndarray, "*runs steps"]
    place: Int[np.ndarray, "*runs steps"]

    def in_rate(
        self,
        rate: Float[np.ndarray, "runs m"],
        times: Float[np.ndarray, "runs m"],
        fitted: Float[np.ndarray, "fitted vectors 1 1"],
    ) -> Float[np.ndarray, "vectors runs m"]:
        """Return the rate of runs with its steps where they happen.

        Between the two samples Simpson's rule gives the strain of each step of the integration, so
        that rates change smoothly with the instant. `rate`, `times`: at ends and middles of steps
        in turn, in 1/s and s, with a straight line where the rate steps. `fitted`: the fitted
        shares.
        """
        share = np.broadcast_to(self.share, (fitted.shape[1], *self.share.shape))
        if len(fitted):
            share = np.where(self.place < 0, share, np.moveaxis(fitted[self.place, :, 0, 0], -1, 0))
        ends = times[:, ::2]
        first, last = ends[:, :-1], ends[:, 1:]
        # of the two steps that meet at an end; beyond those of the record there is none
        reach = np.pad(ends[:, 2:] - ends[:, :-2], ((0, 0), (1, 1)), constant_values=1.0)
        total = np.broadcast_to(rate, (len(share), *rate.shape)).copy()
        for k in range(self.start.shape[1]):
            start, end, change = (of[:, k, None] for of in (self.start, self.end, self.change))
            instant = start + share[:, :, k, None] * (end - start)
            at_ends = np.clip(0.5 + (ends - instant) / reach, 0.0, 1.0)
            at_ends = np.where(ends <= start, 0.0, np.where(ends >= end, 1.0, at_ends))
            strain = np.clip((last - instant) / (last - first), 0.0, 1.0)
            stepped = np.zeros_like(total)
            stepped[..., ::2] = at_ends
            stepped[..., 1::2] = 1.5 * strain - 0.25 * (at_ends[..., :-1] + at_ends[..., 1:])
            straight = np.clip((times - start) / (end - start), 0.0, 1.0)
            between = (times > start) & (times < end)
            total += change * np.where(between, stepped - straight, 0.0)
        return total


def rate_steps(runs: Sequence[Run]) -> RateSteps | None:
    """Return the steps of runs whose instants are fitted or were; None where there is none."""
    most = max(len(run.rate_steps) for run in runs)
    if not most:
        return None
    rows = np.full((len(runs), most, 4), [_NEVER - 1.0, _NEVER, 0.0, 0.5])
    place = np.full((len(runs), most), -1)
    for i, run in enumerate(runs):
        for k, step in enumerate(run.rate_steps):
            rows[i, k] = step.start, step.end, step.change, step.share
            place[i, k] = -1 if step.place is None else step.place
    start, end, change, share = np.moveaxis(rows, -1, 0)
    return RateSteps(start, end, change, share, place)


class TransientFlows(eqx.Module):
    """Flows at a given rate in time on padded grids, with a leading axis of runs.

    `times`: step ends and middles in turn, in s; negative in what came before the record.
    `strain_before`: total strain of the sample before each run.
    `last_step`: position of the last sample of each run among step ends; padding follows.
    `pieces`: of one length in which each step is followed.
    `steps`: steps of the rate whose instants are fitted, or were; None where there is none.
    `cycle`: positions among step ends of the last cycle before the first sample; −1 where the run
        has no periodic start.
    """

    times: Float[np.ndarray, "runs m"]
    commanded_rate: Float[np.ndarray, "runs m"]  # rate there, in 1/s
    sample_index: Int[np.ndarray, "runs n"]  # position of the samples among step ends
    clock_factor: Float[np.ndarray, " runs"]  # shape (runs,)
    strain_before: Float[np.ndarray, " runs"]
    cycle: Int[np.ndarray, "runs 2"]
    last_step: Int[np.ndarray, " runs"]
    pieces: Int[np.ndarray, "runs s"]
    kinematics: Kinematics | None = None  # which flow each run is; None where all are simple shear
    steps: RateSteps | None = None


class Steps(NamedTuple):
    """How runs are stepped through.

    `strain`, `phase`: the most of a step. `pieces`: into how many each is then cut, of all runs or,
    at a given rate in time, of each. `longest`: in s. `relaxation_time`: longest of the fluid, in
    s; see `make_grid`.
    """

    strain: float = 0.25
    pieces: Any = 1
    phase: float = 0.15
    longest: float = np.inf
    relaxation_time: float | None = None


def transients(runs: Sequence[Run], steps: Steps | None = None) -> TransientFlows:
    """Return the flows of runs at a given rate."""
    steps = Steps() if steps is None else steps
    limits: Any = {
        "strain_step": steps.strain, "phase_step": steps.phase, "max_step": steps.longest
    }  # fmt: skip
    settles, grids = steps.relaxation_time, []
    for run, pieces in zip(runs, np.broadcast_to(steps.pieces, len(runs)), strict=True):
        # a window may have cut the first samples off, but not what the instrument did by then
        gap = min([run.time[0], *np.diff(run.time)] if run.time[0] > 0 else np.diff(run.time))
        early = gap * _EARLY_STEPS
        anchors = np.unique(np.concatenate([run.time, early[early < run.time[-1]]]))
        grid, _ = make_grid(run.protocol, anchors, relaxation_time=settles, **limits)
        if settles is None and len(grid) > max(_LONG, 2 * len(anchors)):
            grid, _ = make_grid(run.protocol, anchors, growth=_GROWTH, **limits)
        grid, index = cut(grid, np.searchsorted(grid, run.time), int(pieces))
        grids.append(in_pieces(grid, index, run))
    n_steps = max(2, *(len(grid) for grid, *_ in grids))
    n_samples = max(len(run) for run in runs)
    cycles = [
        np.searchsorted(grid, run.protocol.cycle) if np.ptp(run.protocol.cycle) else (-1, -1)
        for run, (grid, *_) in zip(runs, grids, strict=True)
    ]
    rows = []
    for run, cycle, (grid, index, pieces) in zip(runs, cycles, grids, strict=True):
        spacing = grid[-1] - grid[-2] if len(grid) > 1 else 1.0
        padded = np.concatenate([grid, grid[-1] + spacing * np.arange(1, n_steps - len(grid) + 1)])
        half = np.empty(2 * n_steps - 1)
        half[::2] = padded
        half[1::2] = 0.5 * (padded[1:] + padded[:-1])
        rate = shear_rates(run.protocol, half).copy()
        # beyond its last sample a run is padding: no flow, nothing to blow up; but for one step, so
        # that the slope of the rate at the last sample is the flow's own
        rate[half > grid[-1] + 1.01 * spacing] = 0.0
        rows.append(
            (
                half,
                rate,
                np.pad(index, (0, n_samples - len(run)), mode="edge"),
                run.clock_factor,
                run.strain_before,
                np.asarray(cycle),
                np.asarray(len(grid) - 1),
                np.pad(pieces, (0, n_steps - 1 - len(pieces)), constant_values=1),
            )
        )
    columns = [np.stack(column) for column in zip(*rows, strict=True)]
    return TransientFlows(
        *columns,
        kinematics=stack_kinematics([run.protocol.kinematics for run in runs]),
        steps=rate_steps(runs),
    )


def in_pieces(
    grid: Float[np.ndarray, " s"], index: Int[np.ndarray, " n"], run: Run
) -> tuple[Float[np.ndarray, " m"], Int[np.ndarray, " n"], Int[np.ndarray, " pieces"]]:
    """Return steps of which several in a row of a grid are pieces, and where samples stand.

    Those are of one length, between two samples, and the commanded rate is a straight line in them.
    The pieces of a step double in number, for it may begin with a jump, up to a share of them all.
    """
    if len(grid) < _MANY_IN_A_ROW:
        return grid, index, np.ones(len(grid) - 1, np.int64)
    width, rate = np.diff(grid), shear_rates(run.protocol, grid)
    in_a_row = np.abs(np.diff(width)) <= _ALIKE * width[1:]
    bend = np.abs(rate[2:] - 2.0 * rate[1:-1] + rate[:-2])
    in_a_row &= bend <= _STRAIGHT * (np.abs(rate[2:]) + np.abs(rate[:-2]))
    in_a_row = np.concatenate([[False], in_a_row, [False]])
    in_a_row[index] = False
    for step in run.rate_steps:  # one that is fitted is no straight line
        in_a_row[(grid >= step.start) & (grid <= step.end)] = False
    ends = np.flatnonzero(~in_a_row)
    kept = ~in_a_row
    for first, end in pairwise(ends):
        if end - first < _MANY_IN_A_ROW:
            kept[first:end] = True
            continue
        place, most = first, (end - first) // _SHARES
        while place < end:
            kept[place] = True
            place += min(max(place - first, 1), most)
    places = np.flatnonzero(kept)
    return grid[places], np.searchsorted(places, index), np.diff(places)


class StressFlows(eqx.Module):
    """Runs at a given stress on padded grids, with a leading axis of runs.

    `sample_index`, `clock_factor`, `kinematics`: as in `TransientFlows`.
    """

    times: Float[np.ndarray, "runs s"]  # step ends, shape (runs, s), in s
    imposed: Float[np.ndarray, "runs s"]  # recorded stress there, in Pa
    sample_index: Int[np.ndarray, "runs n"]
    clock_factor: Float[np.ndarray, " runs"]
    kinematics: Kinematics | None = None


def at_given_stress(runs: Sequence[Run], steps: Steps) -> StressFlows:
    """Return the flows of runs at a given stress."""
    grids = [
        cut(stress_grid(run.protocol, run.time, steps.strain), np.zeros(1, int), steps.pieces)[0]
        for run in runs
    ]
    n_steps, n_samples = max(map(len, grids)), max(len(run) for run in runs)
    rows = []
    for run, grid in zip(runs, grids, strict=True):
        index = np.searchsorted(grid, run.time)
        last = grid[-1] - grid[-2]
        padded = np.concatenate([grid, grid[-1] + last * np.arange(1, n_steps - len(grid) + 1)])
        imposed = shear_rates(run.protocol, padded)
        index = np.pad(index, (0, n_samples - len(run)), mode="edge")
        rows.append((padded, imposed, index, run.clock_factor))
    columns = [np.stack(column) for column in zip(*rows, strict=True)]
    return StressFlows(
        *columns, kinematics=stack_kinematics([run.protocol.kinematics for run in runs])
    )


class SteadyFlows(eqx.Module):
    """Flow curves, padded, with a leading axis of runs: a sample is a steady state at its rate."""

    rate: Float[np.ndarray, "runs n"]  # in 1/s, shape (runs, n)
    kinematics: Kinematics | None = None  # as in `TransientFlows`


def steady_states(runs: Sequence[Run]) -> SteadyFlows:
    """Return the flows of flow curves."""
    n = max(len(run) for run in runs)
    # a padded sample is one more of the last
    rates = [np.pad(run.rate, (0, n - len(run)), mode="edge") for run in runs]
    kinematics = stack_kinematics([run.protocol.kinematics for run in runs])
    return SteadyFlows(np.stack(rates), kinematics)


# Half a cycle in the loop: as many steps as one of so much strain at least, whatever the strain
_FEWEST = 8.0

Places = tuple[int, tuple[int, ...]]
"""Of a run that is a modulus whether it is G′ (0) or G″ (1), and which states its samples are."""


class PeriodicFlows(eqx.Module):
    """Periodic states, each of which is solved for by itself; both moduli of each are computed.

    `strain`, `frequency`: amplitude and rad/s.
    """

    strain: Float[np.ndarray, " states"]
    frequency: Float[np.ndarray, " states"]
    steps: Int[np.ndarray, " states"]  # of half a cycle: more at large strain


def oscillations(runs: Sequence[Run], each: Steps) -> tuple[PeriodicFlows, tuple[Places, ...]]:
    """Return the states of sweeps, and of each run which of them are its own."""
    # G′ and G″ of one sweep are computed together
    of_runs = [
        np.stack([np.asarray(run.strain), np.asarray(run.angular_frequency)], axis=1)
        for run in runs
    ]
    states, number = np.unique(np.concatenate(of_runs), axis=0, return_inverse=True)
    ends = np.cumsum([len(own) for own in of_runs])[:-1]
    places = tuple(
        (MODULI.index(run.quantity), tuple(own.tolist()))
        for run, own in zip(runs, np.split(number.ravel(), ends), strict=True)
    )
    strain, frequency = states.T
    most = each.strain / each.pieces
    steps = [steps_of_half_cycle(max(float(one), _FEWEST / 2.0), most) for one in strain]
    return PeriodicFlows(strain, frequency, np.array(steps)), places


Flows = TransientFlows | SteadyFlows | StressFlows | PeriodicFlows
"""Flows of one control, which share one program; of all but oscillations one row for each run."""


def at_radii(part: Flows, radii: Float[np.ndarray, " r"]) -> Flows | None:
    """Return flows between plates at shares of the radius of the rim, whose rate is commanded.

    Those of the first radius come first. None where that is no shear at a given rate.
    """
    if isinstance(part, StressFlows) or getattr(part, "kinematics", None) is not None:
        return None

    def repeated(leaf: ArrayLike) -> np.ndarray:
        return np.concatenate([np.asarray(leaf)] * len(radii))

    def scaled(values: ArrayLike) -> np.ndarray:
        return np.concatenate([radius * np.asarray(values) for radius in radii])

    many = jax.tree.map(repeated, part)
    if isinstance(part, PeriodicFlows):
        return replace(many, strain=scaled(part.strain))
    if isinstance(part, SteadyFlows):
        return replace(many, rate=scaled(part.rate))
    steps = part.steps and replace(many.steps, change=scaled(part.steps.change))
    strain, rate = scaled(part.strain_before), scaled(part.commanded_rate)
    return replace(many, commanded_rate=rate, strain_before=strain, steps=steps)


class Batch(eqx.Module):
    """Runs of one control or several, in parts of which each has a program of its own.

    `parts`, `rows`: the flows of each control, simple shear apart, and which runs they are.
    `moduli`: of each run that is a modulus, which one, and where its states stand in their part.
    `recorded`: of all runs in their order, in Pa or as a strain; zero at padding.
    """

    parts: tuple[Flows, ...]
    rows: tuple[tuple[int, ...], ...] = eqx.field(static=True)
    moduli: tuple[Places, ...] = eqx.field(static=True)
    recorded: Float[np.ndarray, "runs n"]


def make_batch(runs: Sequence[Run], strain_step: float = 0.25, **how: Any) -> Batch:
    """Return runs as a batch.

    `runs`: of each record one. `strain_step`: largest strain of a step. `**how`: see `Steps`.
    """
    steps = Steps(strain_step, **how)
    # simple shear apart from other flows, for it costs less
    kinds = [
        (flow.control, flow.control == "rate" and flow.kinematics is not None)
        for flow in (run.protocol for run in runs)
    ]
    rows = tuple(
        tuple(i for i, own in enumerate(kinds) if own == kind) for kind in dict.fromkeys(kinds)
    )
    moduli: tuple[Places, ...] = ()
    parts: list[Flows] = []
    for at in rows:
        own = [runs[i] for i in at]
        control = own[0].protocol.control
        if control == "oscillation":
            part, moduli = oscillations(own, steps)
        elif control == "steady":
            part = steady_states(own)
        elif control == "stress":
            part = at_given_stress(own, steps)
        else:
            part = transients(own, steps)
        parts.append(part)
    recorded = np.zeros((len(runs), max(map(len, runs))))
    for row, run in zip(recorded, runs, strict=True):
        row[: len(run)] = run.recorded
    return Batch(tuple(parts), rows, moduli, recorded)
