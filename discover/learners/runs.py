"""Runs as learners take them."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, Float

from discover.dataset.material_functions import as_compared
from discover.dataset.run import Run, require_later_samples
from discover.errors import InputError
from discover.first_use import require_double
from discover.forward.flow_batch import FlowBatch
from discover.protocols import settled
from discover.protocols.kinematics import STATES
from discover.words import percent_of

_MAKE = "Load a folder with load_dataset, or make a data set of a table with from_dataframe."


def as_runs(
    runs: Iterable[Run], relaxation_time: ArrayLike = 0.0, relaxes: bool = True
) -> list[Run]:
    """Return the runs as a list, each as `as_compared` has it.

    `relaxation_time`: of the modes, in s. `relaxes`: whether the fluid is known to relax, so that a
    periodic start is solved for; otherwise, or at a given stress, cycles are put before the run.
    Raises InputError if there is no run, one is something else, a mode is too slow, or JAX computes
    in single precision.
    """
    require_double()
    if isinstance(runs, Run):
        raise InputError(
            f"A learner takes several runs; got the single run {runs.name!r}. Put it in a list: "
            "fit([run])."
        )
    if isinstance(runs, str) or not isinstance(runs, Iterable):
        raise InputError(
            f"A learner takes a data set or a sequence of Run; got a {type(runs).__name__}. {_MAKE}"
        )
    listed = list(runs)
    if not listed:
        raise InputError("A learner needs at least one run; got none.")
    for run in listed:
        if not isinstance(run, Run):
            raise InputError(
                f"A learner takes a data set or a sequence of Run; got a {type(runs).__name__} "
                f"that holds a {type(run).__name__}. {_MAKE}"
            )
    require_later_samples(listed)
    longest = float(np.max(np.asarray(relaxation_time)))
    return [waiting(run, longest, relaxes) for run in as_compared(listed)]


def waiting(run: Run, relaxation_time: float, relaxes: bool) -> Run:
    """Return a run with the cycles before it to wait for, if its state is not solved for."""
    if relaxes and run.protocol.control == "rate":
        return run
    return replace(run, protocol=settled(run.protocol, relaxation_time))


def require_signal(runs: Sequence[Run]) -> None:
    """Refuse runs whose record is zero throughout."""
    for run in runs:
        if not np.any(run.recorded):
            raise InputError(
                f"The shear stress of the run {run.name!r} is zero throughout: it says nothing of "
                "the law. Leave the run out."
            )


WORTH_IT = 0.5
"""Share of the steps that a rough grid may have at most: it has programs of its own to compile."""

_STRAIN_STEP, _PHASE_STEP, _GROWTH = 0.4, 0.3, 0.1


def rough_limits(
    flows: FlowBatch, relaxation_time: Float[np.ndarray, " k"]
) -> Mapping[str, float] | None:
    """Return limits of longer steps, as `make_grid` takes them; None where the flows have none.

    Steps grow after a change of the rate up to a strain of one, and follow the fastest relaxation
    where the fine grid does, else the slowest: over steps of many relaxation times a law that
    relaxes faster than the known one diverges.
    """
    controls = {protocols.control for protocols, _ in flows.parts}
    if not controls <= {"rate", *STATES}:
        return None
    if "rate" not in controls:
        return {"strain_step": _STRAIN_STEP}
    longest = max(
        float(np.max(np.diff(grid.times, axis=1)))
        for protocols, grid in flows.parts
        if protocols.control == "rate"
    )
    times = np.asarray(relaxation_time)
    followed = float(np.min(times) if longest <= np.min(times) else np.max(times))
    return {
        "strain_step": _STRAIN_STEP,
        "phase_step": _PHASE_STEP,
        "growth": _GROWTH,
        "max_step": max(longest, followed),
    }


SETTLED = 50.0
"""Relaxation times after a change of the rate from which on time passes faster, in proportion to
what has passed: a law that relaxes fifty times as slowly as the known one is still followed."""

_SAME, _OF_MISFIT = 1e-3, 0.1
"""Difference of a law's stress on the shortened and on the whole runs, over its size and over its
misfit: holds were shortened rightly if it is below either."""

_CHANGE = 0.01
"""A rate is held while it stays within this fraction of what it was first."""


_Problem = TypeVar("_Problem", bound=Any)  # a learner's, with its `flows`


def shorter_where_it_pays(
    runs: Sequence[Run],
    problem: _Problem,
    make: Callable[[Sequence[Run]], _Problem],
    relaxation_time: Float[np.ndarray, " k"],
    affordable: float,
) -> tuple[Sequence[Run], _Problem]:
    """Return runs with shorter holds and their problem where that saves half the steps or more.

    `make`: returns the problem of other runs. `relaxation_time`: in s. `affordable`: modes times
    steps up to which runs are followed whole.
    """
    times = np.atleast_1d(np.asarray(relaxation_time, dtype=float))
    if times.size * problem.flows.n_steps <= affordable:
        return runs, problem
    shorter = with_shorter_holds(runs, float(np.max(times)))
    if all(one is other for one, other in zip(shorter, runs, strict=True)):
        return runs, problem
    laid = make(shorter)
    paid = laid.flows.n_steps <= WORTH_IT * problem.flows.n_steps
    return (shorter, laid) if paid else (runs, problem)


def shortened_rightly(
    whole: Any,
    shorter: Any,
    recorded: tuple[Sequence[Float[np.ndarray, " _"]], Sequence[Float[np.ndarray, " _"]]],
    misfit: float,
) -> str:
    """Return what shortening passed over and what it changes; empty if it changes too much.

    `recorded`: predictions of the law found in each whole and in each shortened run. `misfit`: of
    the law, relative to the records.
    """
    off = float(
        np.max(
            [np.sqrt(np.mean((a - b) ** 2) / np.mean(a**2)) for a, b in zip(*recorded, strict=True)]
        )
    )
    if not off <= max(_SAME, _OF_MISFIT * misfit):  # nor where the law diverges
        return ""
    share = whole.flows.n_steps / shorter.flows.n_steps
    return (
        f"to save time the rates that are held for more than {SETTLED:.0f} relaxation times were "
        f"followed in {share:.2g} times fewer steps, which changes the stress of the law found by "
        f"{'less than 0.1 %' if off < 1e-3 else percent_of(off)} (recipe 'thorough' follows the "
        "whole runs)"
    )


def with_shorter_holds(runs: Sequence[Run], relaxation_time: float) -> list[Run]:
    """Return runs whose holds beyond `SETTLED` relaxation times are shortened to their logarithm.

    Samples keep stress and order; those after a long hold come earlier. Runs without such a hold,
    or that oscillate, stay. `relaxation_time`: the longest, in s.
    """
    return [_shortened(run, SETTLED * relaxation_time) for run in runs]


def _shortened(run: Run, settled: float) -> Run:
    protocol = run.protocol
    start, end = np.asarray(protocol.cycle)
    if protocol.control != "rate" or np.any(np.asarray(protocol.amplitudes)) or start != end:
        return run
    knots, rates = np.asarray(protocol.table_times), np.asarray(protocol.table_rates)
    begins, last = float(protocol.begins), run.time[-1]
    before = rates[(knots >= begins) & (knots < 0.0)]
    if begins < -settled and np.ptp(before) > 0.0:  # no hold came before, but a history of its own
        return run
    changes = _changes(knots, rates)
    holds = np.diff(np.append(changes[changes < last], last))
    if not np.any(holds > settled):
        return run

    def on_clock(times: np.ndarray) -> np.ndarray:
        return _on_clock(times, changes, settled)

    faster = replace(
        protocol,
        table_times=jnp.asarray(on_clock(knots)),
        begins=jnp.asarray(on_clock(np.array([begins]))[0]),
    )
    # the rate before is part of the protocol by now
    return replace(run, time=on_clock(run.time), protocol=faster, strain=None, rate_before=0.0)


def _changes(
    knots: Float[np.ndarray, " m"], rates: Float[np.ndarray, " m"]
) -> Float[np.ndarray, " c"]:
    """Return when the rate changed, from the beginning of the record on."""
    held, changes = rates[int(np.searchsorted(knots, 0.0, side="right")) - 1], [0.0]
    for time, rate in zip(knots, rates, strict=True):
        if time > 0.0 and abs(rate - held) > _CHANGE * max(abs(rate), abs(held)):
            held = rate
            changes.append(float(time))
    return np.array(changes)


def _on_clock(
    times: Float[np.ndarray, " n"], changes: Float[np.ndarray, " c"], settled: float
) -> Float[np.ndarray, " n"]:
    """Return times on the clock that slows down as the time since a change grows."""

    def passed(since: np.ndarray) -> np.ndarray:
        later = np.maximum(since / settled, 1.0)
        return np.minimum(since, settled) + settled * np.log(later)

    begun = np.concatenate([[0.0], np.cumsum(passed(np.diff(changes)))])
    last = np.clip(np.searchsorted(changes, times, side="right") - 1, 0, None)
    since = times - changes[last]
    after = begun[last] + passed(np.maximum(since, 0.0))
    # what came before began as long ago as it takes to settle
    return np.where(times > 0.0, after, np.maximum(times, -settled))
