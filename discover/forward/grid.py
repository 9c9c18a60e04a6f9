"""Fixed time grids, made once on the host, so that every run of a batch shares one compilation."""

from collections.abc import Callable, Sequence
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array, Float, Int
from scipy.optimize import isotonic_regression

from discover.errors import InputError
from discover.programs import on_device
from discover.protocols.kinematics import STATES
from discover.protocols.protocol import FlowProtocol, in_table

STRAIN_STEP = 0.1
"""Largest strain of a step by default: the method then errs by about 1e-6 of the stress."""

MAX_GRID_POINTS = 200_000
"""Of one run: more come of a wrong unit."""

# Steps of a jump, growth of those after it, steps between any two of these and of the samples,
# their strain in that of a run at a given rate. So creep of 9 modes over five decades in 60 samples
# errs by 2e-5 of the strain, that of a law with a solvent by as much
_JUMP_STEPS, _GROWTH, _STEPS_BETWEEN, _LONGER = 24, 0.3, 2, 2.0

# A stress jumps where it takes less than this share of the time from there to the next knot
_SUDDEN = 0.01

# A stress is constant while it changes by less than this share of the largest from sample to sample
_CONSTANT = 0.01


def stress_grid(
    protocol: FlowProtocol, times: Float[np.ndarray, " n"], strain_step: float = 0.25
) -> Float[np.ndarray, " s"]:
    """Return step times for a run at a given stress.

    Every sample and kink of the stress is a step, and there is one between any two samples. A jump
    is gone through in even steps, and what follows in steps that grow with the time since. No step
    takes more than twice `strain_step` of the strain that the protocol holds as recorded.
    """
    begins, end = float(protocol.begins), float(times[-1])
    knots = np.asarray(protocol.table_times)
    levels = np.asarray(protocol.table_rates)
    # a record of thousands at one level has a knot at each sample, and no kink there
    slope = np.diff(levels) / np.diff(knots)
    bends = np.concatenate([[True], np.diff(slope) != 0.0, [True]]) if len(knots) > 1 else True
    knots_inside = knots[(knots >= begins) & (knots <= end) & bends]
    parts = [np.array([begins]), times, knots_inside]
    width = np.diff(knots)
    jumps = np.flatnonzero((width[:-1] < _SUDDEN * width[1:]) & (np.diff(levels)[:-1] != 0.0))
    for start, stop in zip(knots[jumps], knots[jumps + 1], strict=True):
        parts.append(np.linspace(start, stop, _JUMP_STEPS + 1))
        later = times[times > stop]
        if later.size:
            count = int(np.ceil(np.log((end - start) / (stop - start)) / np.log1p(_GROWTH)))
            parts.append(start + np.geomspace(stop - start, end - start, max(count, 2)))
    anchors = np.unique(np.concatenate(parts))
    anchors = anchors[(anchors >= begins) & (anchors <= end)]
    strain = np.zeros(1)
    moved = np.zeros(len(anchors) - 1)
    if protocol.table_strains is not None:
        strain = np.asarray(protocol.table_strains)
        moved = np.abs(np.diff(np.interp(anchors, knots, _without_noise(levels, strain))))
    # a smooth stress has knots between its samples, which are steps enough
    between = np.isin(anchors, np.setdiff1d(knots_inside, times)) & (anchors > 0.0)
    least = np.where(between[1:] | between[:-1], 1, _STEPS_BETWEEN)
    pieces = np.maximum(least, np.ceil(moved / (_LONGER * strain_step))).astype(int)
    if np.sum(pieces) > MAX_GRID_POINTS:
        raise InputError(
            f"A run at a given stress with {len(times)} samples and strains up to "
            f"{np.max(np.abs(strain)):g} would need {np.sum(pieces)} steps (at most "
            f"{MAX_GRID_POINTS}). Check the unit of the strain, or thin the run."
        )
    filled = [
        a + (b - a) * np.arange(n) / n
        for a, b, n in zip(anchors[:-1], anchors[1:], pieces, strict=True)
    ]
    return np.concatenate([*filled, anchors[-1:]])


def _without_noise(levels, strain) -> Float[np.ndarray, " n"]:
    """Return the strain as it goes one way where the stress is constant.

    Noise would be taken for flow: 1 % of a strain of 200 for ten steps from sample to sample.
    """
    changes = np.abs(np.diff(levels)) > _CONSTANT * np.max(np.abs(levels), initial=0.0)
    pieces = np.split(strain, np.flatnonzero(changes) + 1)
    return np.concatenate([_one_way(piece) if len(piece) > 2 else piece for piece in pieces])


def _one_way(strain) -> Float[np.ndarray, " n"]:
    ways = [isotonic_regression(strain, increasing=up).x for up in (True, False)]
    return min(ways, key=lambda way: float(np.sum((way - strain) ** 2)))


COARSEST_STRAIN = 1.0
"""Strain of one step beyond which the method may lose its stability in nonlinear flow."""

# The same where the relaxation time is not known, in a record and before it, where a steady state
# is to be reached: a trial law that thins relaxes far faster than the flow turns it
_COARSEST_OF_ANY, _COARSEST_BEFORE = 0.5, 0.25

# Of a steady flow before the record: steps, their shrinking towards its end, relaxation times
_FEWEST_HISTORY_STEPS, _HISTORY_SHRINKS, _SETTLED_BEFORE = 100, 0.08, 50.0

# Steps of a relaxation: the first, in the time to the first sample, and by how much each is longer
_FIRST_AT_REST, _GROWTH_AT_REST = 0.02, 0.2

# Half a cycle of an oscillation: at most this much strain in a step, at least this many steps, and
# a limit that only a strain given in the wrong unit reaches
_FEWEST_OF_HALF, _MOST_OF_HALF = 12.0, 4000
_STRAIN_OF_CYCLE = 0.4

# Steps of a cycle are rounded up to multiples of this, so that runs share a compilation
_STEPS_OF_CYCLE = 16

# A rate is constant while it changes by less than this fraction from sample to sample
_CHANGE = 0.05

# Of steps that grow as the fluid settles: the fraction up to which a rate stays what it was first,
# for a change sets off a disturbance of its size; the most of the time since such a change, for a
# structure of the fluid may settle ever more slowly; the share of relaxation that is counted on,
# for a law that is tried may take some of it off; the order of the method
_DISTURBANCE, _GROWTH_AS_IT_SETTLES, _SURE, _ORDER = 0.01, 0.05, 0.5, 4


class IntegrationGrid(eqx.Module):
    """Where to step and where to sample, for one run or, with a leading axis, a batch of runs.

    `times`: of steps in s, increasing from where the protocol begins, padded past the last sample.
    `sample_index`: position in `times` of every sample; padded with the last one.
    `phase`: of periodic oscillations ωt at step ends and middles in turn over half a cycle; else
        None.
    `cycle`: steps of the cycle with which a grid begins that had gone on for ever; 0 of a run that
        had not, None where no run had.
    """

    times: Float[Array, "*batch s"]
    sample_index: Int[Array, "*batch n"]
    phase: Float[Array, "*batch m"] | None = None
    cycle: Int[Array, "*batch"] | None = None
    cycle_steps: int = eqx.field(static=True, default=0)  # the most steps that such a cycle has

    @property
    def sample_times(self) -> Float[Array, "*batch n"]:
        """Times of the samples in s; of steady and periodic states they count them."""
        return self.times[self.sample_index]

    def of_states(self, solve: Callable[[Float[Array, ""]], Any]) -> Any:
        """Return what is found of each steady state, once each, at the samples of one grid."""
        found = jax.vmap(solve)(self.times)
        return jax.tree.map(lambda leaf: leaf[self.sample_index], found)


def make_grid(
    protocol: FlowProtocol,
    times: Float[np.ndarray, " n"],
    strain_step: float = STRAIN_STEP,
    phase_step: float = 0.15,
    max_step: float = np.inf,
    growth: float = 0.0,
    relaxation_time: float | None = None,
    from_cycle: bool = False,
    pieces: int = 1,
) -> tuple[Float[np.ndarray, " s"], Int[np.ndarray, " n"]]:
    """Return step times and the position of each sample among them.

    Every sample and kink of the protocol is a step; between them none takes more than `strain_step`
    of strain or `phase_step` radians: with the defaults the fourth-order method errs by about 1e-6
    of the stress. A constant rate before t = 0 is gone through in steps of `COARSEST_STRAIN`, or a
    quarter where the relaxation time is not known, that shrink towards its end: a steady state is a
    fixed point of the method whatever its step, but stable in short ones only.

    `times`: of samples in s, increasing, from 0 on.
    `max_step`: largest step in s.
    `growth`: while the rate of a table is constant, steps may grow to this fraction of the time
        since it changed, up to `COARSEST_STRAIN` where `max_step` limits them too, else half of it.
    `relaxation_time`: longest of the fluid, in s. Steps then grow while the rate is constant, up to
        `COARSEST_STRAIN` and this time: what a change set off dies out as exp(−t/λ), so steps that
        grow as exp(t/4λ) from t = λ on add no more to the error of a fourth-order method. Half of
        this relaxation is counted on. None leaves steps as they are.
    `from_cycle`: whether what had gone on for ever begins with its last cycle, which is solved for.
    `pieces`: into how many of one length every step is cut in the end; states are not stepped.

    Raises InputError if the run would need an absurd number of steps.
    """
    times = np.asarray(times, dtype=float)
    if protocol.control in STATES:
        return times, np.arange(len(times))  # time counts the samples, and nothing is stepped
    if protocol.control == "stress":
        grid = stress_grid(protocol, times, strain_step)
        return cut(grid, np.searchsorted(grid, times), pieces)
    cycle = np.asarray(protocol.cycle)
    from_cycle = from_cycle and _follows_cycle(protocol, times)
    begins = float(cycle[0] if from_cycle else protocol.begins)
    end = float(times[-1])
    knots = np.asarray(protocol.table_times)
    rates = np.asarray(protocol.table_rates)
    kinks = knots[(knots > begins) & (knots < end)]
    jumps = np.intersect1d(kinks, knots[1:][np.diff(knots) <= 0.0])
    # Step to just before a jump and on from it, so that no step straddles one
    before = jumps - 1e-12 * np.where(jumps == 0.0, -begins, np.abs(jumps))
    later = times[times > 0.0]
    first = float(later[0]) if later.size else np.inf
    steady = _steady_history(protocol, first, relaxation_time)
    if steady.size:
        begins = float(steady[0])
    # what is gone through in steady steps sets no pace for the record
    recorded = rates[max(int(np.searchsorted(knots, 0.0, side="right")) - 1, 0) :]
    table = np.max(np.abs(recorded if steady.size else rates))
    rest = _relaxation(times) if begins < 0.0 and not np.any(recorded) else ()
    anchors = np.unique(np.concatenate([[begins, 0.0], times, kinks, before, steady, rest, cycle]))
    intensity = 1.0 if protocol.kinematics is None else float(protocol.kinematics.intensity)
    fastest = intensity * (table + np.sum(np.abs(np.asarray(protocol.amplitudes))))
    waves = np.asarray(protocol.frequencies)[np.asarray(protocol.amplitudes) != 0.0]
    limit = min(
        max_step,
        strain_step / fastest if fastest > 0 else np.inf,
        phase_step / np.max(np.abs(waves)) if waves.size and np.max(np.abs(waves)) > 0 else np.inf,
    )
    gaps = np.diff(anchors)
    limits = np.full(gaps.shape, limit)
    if growth > 0.0 and not np.any(np.asarray(protocol.amplitudes)) and np.isfinite(limit):
        coarsest = COARSEST_STRAIN if np.isfinite(max_step) else _COARSEST_OF_ANY
        grown = _grown(anchors, knots, rates, growth, coarsest)
        limits = np.minimum(max_step, np.maximum(limit, grown))
    elif relaxation_time is not None and not np.any(np.asarray(protocol.amplitudes)):
        at = intensity * in_table(np, anchors, knots, rates)
        limits = np.minimum(max_step, _settled(anchors, at, limit, relaxation_time / _SURE))
    if steady.size:
        limits[anchors[:-1] < 0.0] = np.inf
    counts = np.maximum(1, np.ceil(gaps / limits - 1e-9)) if gaps.size else np.zeros(0)
    if np.sum(counts) > MAX_GRID_POINTS:
        raise InputError(
            f"A run of {end - begins:g} s at rates up to {fastest:g} 1/s would need "
            f"{int(np.sum(counts))} steps (at most {MAX_GRID_POINTS}). Check the units of time and "
            "rate, or thin the run."
        )
    grid = np.concatenate(
        [
            a + gap * np.arange(int(n)) / n
            for a, gap, n in zip(anchors[:-1], gaps, counts, strict=True)
        ]
        + [anchors[-1:]]
    )
    return cut(grid, np.searchsorted(grid, times), pieces)


def cut(
    times: Float[np.ndarray, " s"], index: Int[np.ndarray, " n"], pieces: int
) -> tuple[Float[np.ndarray, " m"], Int[np.ndarray, " n"]]:
    """Return step times with every step cut into pieces of one length, and where samples stand."""
    share = np.arange(pieces) / pieces
    between = times[:-1, None] + np.diff(times)[:, None] * share
    return np.append(between.ravel(), times[-1]), pieces * index


def was_periodic(protocol: FlowProtocol) -> bool:
    """Return whether a flow at a given rate is an oscillation that had gone on for ever."""
    return protocol.control == "rate" and bool(np.ptp(np.asarray(protocol.cycle)))


def _follows_cycle(protocol: FlowProtocol, times: Float[np.ndarray, " n"]) -> bool:
    end = float(np.asarray(protocol.cycle)[1])
    return was_periodic(protocol) and float(times[0]) >= end - 1e-9 * abs(end)


def _relaxation(times: Float[np.ndarray, " n"]) -> Float[np.ndarray, " p"]:
    """Return steps that grow with the time since the flow stopped: no strain sets their pace."""
    later = times[times > 0.0]
    if not later.size:
        return np.zeros(0)
    first = _FIRST_AT_REST * later[0]
    count = int(np.ceil(np.log(later[-1] / first) / np.log1p(_GROWTH_AT_REST)))
    return np.geomspace(first, later[-1], count + 1)[:-1]


def _steady_history(
    protocol: FlowProtocol, first: float, relaxation_time: float | None
) -> Float[np.ndarray, " p"]:
    """Return steps through a constant rate before t = 0; none where it was anything else.

    The last of them is as long as the first of the record. It begins later where the fluid settles
    sooner: steps of many relaxation times would run away.
    """
    begins = float(protocol.begins)
    knots, rates = np.asarray(protocol.table_times), np.asarray(protocol.table_rates)
    history = rates[(knots >= begins) & (knots <= 0.0)][:2]
    constant = len(history) == 2 and history[0] == history[1] and knots[1] == 0.0
    if begins == 0.0 or np.any(np.asarray(protocol.amplitudes)) or not constant:
        return np.zeros(0)
    if relaxation_time is not None:
        begins = max(begins, -_SETTLED_BEFORE * relaxation_time)
    strain = abs(history[0] * begins)
    coarsest = _COARSEST_BEFORE if relaxation_time is None else COARSEST_STRAIN
    count = max(_FEWEST_HISTORY_STEPS, int(np.ceil(strain / coarsest)))
    coarse = np.linspace(begins, 0.0, count + 1)[:-1]
    # the fixed point is only reached in steps that follow the relaxation, however fast it is, so
    # the last ones shrink to the first of the record
    first, longest = min(first, -begins / count), -begins / count / _HISTORY_SHRINKS
    fine = -np.geomspace(longest, first, 1 + int(np.log(longest / first) / _HISTORY_SHRINKS))
    return np.concatenate([coarse[coarse < fine[0]], fine])


def _grown(
    anchors: np.ndarray, knots: np.ndarray, rates: np.ndarray, growth: float, strain: float
) -> Float[np.ndarray, " gaps"]:
    """Return the step that each gap between anchors allows, for the time since a change of rate."""
    at = in_table(np, anchors, knots, rates)
    size = np.maximum(np.abs(at[1:]), np.abs(at[:-1]))
    changes = np.abs(np.diff(at)) > _CHANGE * size
    ends = np.where(changes, anchors[1:], 0.0)
    since = anchors[:-1] - np.concatenate([[0.0], np.maximum.accumulate(ends)[:-1]])
    coarsest = strain / np.maximum(size, 1e-300)
    return np.where(changes, 0.0, np.minimum(growth * since, coarsest))


def _settled(
    anchors: np.ndarray, at: np.ndarray, limit: float, settling_time: float
) -> Float[np.ndarray, " gaps"]:
    """Return the step of each gap between anchors as what a change of the rate set off dies out."""
    first, last, since = at[0], anchors[0], np.zeros(len(anchors) - 1)
    for i, rate in enumerate(at[1:]):
        if abs(rate - first) > _DISTURBANCE * max(abs(rate), abs(first)):
            first, last = rate, anchors[i + 1]
        else:
            since[i] = anchors[i] - last
    size = np.maximum(np.abs(at[1:]), np.abs(at[:-1]))
    # in steps of many relaxation times the method iterates N/decay, which runs away, or comes to
    # rest elsewhere, where a law adds two thirds of the known relaxation or more
    coarsest = np.minimum(COARSEST_STRAIN / np.maximum(size, 1e-300), _SURE * settling_time)
    steady = np.minimum(coarsest, _GROWTH_AS_IT_SETTLES * since)
    # what is more than it takes to reach them changes nothing
    died_out = np.clip(since / settling_time - 1.0, 0.0, 100.0)
    return np.maximum(limit, np.minimum(steady, limit * np.exp(died_out / _ORDER)))


def make_grids(
    protocols: Sequence[FlowProtocol],
    times: Sequence[Float[np.ndarray, " _"]],
    relaxation_time: float | None = None,
    from_cycle: bool = False,
    **limits: Any,
) -> IntegrationGrid:
    """Return the grids of several runs of one control, padded to one shape; see `make_grid`."""
    grids = [
        make_grid(p, t, relaxation_time=relaxation_time, from_cycle=from_cycle, **limits)
        for p, t in zip(protocols, times, strict=True)
    ]
    cycles = [
        np.searchsorted(grid, float(p.cycle[1])) if from_cycle and _follows_cycle(p, t) else 0
        for p, t, (grid, _) in zip(protocols, times, grids, strict=True)
    ]
    cycle_steps = -(-int(max(cycles)) // _STEPS_OF_CYCLE) * _STEPS_OF_CYCLE
    n_steps = max(max(len(g) for g, _ in grids), cycle_steps + 1, 2)
    n_samples = max(len(i) for _, i in grids)
    stacked = [], []
    for grid, index in grids:
        spacing = grid[-1] - grid[-2] if len(grid) > 1 else 1.0
        padding = grid[-1] + spacing * np.arange(1, n_steps - len(grid) + 1)
        stacked[0].append(np.concatenate([grid, padding]))
        stacked[1].append(np.pad(index, (0, n_samples - len(index)), mode="edge"))
    all_times, indices = (on_device(np.stack(s)) for s in stacked)
    if protocols[0].control != "oscillation":
        cycle = on_device(np.array(cycles)) if cycle_steps else None
        return IntegrationGrid(all_times, indices, cycle=cycle, cycle_steps=cycle_steps)
    largest = max(float(np.max(np.asarray(p.table_strains))) for p in protocols)
    # a cycle of so large steps errs by 5e-6 of the moduli at a strain of 10 (tested), and one of
    # twice these, on a rough grid, by sixteen times as much
    strain_step = limits.get("strain_step", STRAIN_STEP)
    step = min(4.0 * strain_step, max(_STRAIN_OF_CYCLE, 2.0 * strain_step))
    step /= limits.get("pieces", 1)
    steps = steps_of_half_cycle(max(largest, 0.5 * _FEWEST_OF_HALF), step)
    phases = on_device(np.tile(np.linspace(0.0, np.pi, 2 * steps + 1), (len(grids), 1)))
    return IntegrationGrid(all_times, indices, phases)


def steps_of_half_cycle(strain: float, strain_step: float) -> int:
    """Return how many steps half a cycle takes of an oscillation of this amplitude of strain."""
    # half a cycle goes through twice the amplitude
    return int(min(np.ceil(2.0 * strain / strain_step), _MOST_OF_HALF))
