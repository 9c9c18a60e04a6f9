"""Records of one material held against one another: repeats, copies, loadings, sequences."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float

from discover.dataset.records.thinning import nearest
from discover.dataset.run import LARGEST, Run
from discover.errors import InputError
from discover.protocols.kinematics import STATES
from discover.protocols.protocol import shear_rates
from discover.statistics.noise_model import rms
from discover.statistics.whiteness import sample_to_sample_noise

_SAME = 0.02  # relative difference of rates, and of what runs.csv says of two runs, that is none
_FEWEST_SAMPLES = 10
# share of the longer run that both must cover for their rates to be held against each other there
# alone
_SHARED = 0.5
_FEWEST = 8  # samples at the same times; of fewer, equal digits may be chance
# of what changes from sample to sample: two records of one test differ by √2 of it, one record
# written with other digits by far less
_ROUNDED = 0.1
# What a source counts or sums up of a record, and no condition of the test
_NO_CONDITION = ("n_points", "final_strain", "max_abs_strain", "start_time_in_sequence_s")


def repeated_tests(runs: Sequence[Run]) -> tuple[tuple[str, ...], ...]:
    """Return the names of the runs of each test repeated: rates and all conditions agree."""
    groups: list[list[Run]] = []
    for run in runs:
        if run.protocol.control in (*STATES, "stress") or len(run) < _FEWEST_SAMPLES:
            continue
        group = next((group for group in groups if _same_test(group[0], run)), None)
        if group is None:
            groups.append(group := [])
        group.append(run)
    return tuple(tuple(run.name for run in group) for group in groups if len(group) > 1)


def count_flows(runs: Sequence[Run]) -> int:
    """Return the number of different flows: a repeated test is one, as is a state of a table."""
    named = [*{run.name: run for run in runs}.values()]
    again = sum(len(group) - 1 for group in repeated_tests(named))
    states = sum(len(run) - 1 for run in named if run.protocol.control in STATES)
    return len(named) - again + states


def _same_test(one: Run, other: Run) -> bool:
    numbers: list[tuple[Any, Any]]
    numbers = [(one.rate_before, other.rate_before), (one.strain_before, other.strain_before)]
    for name in {*one.metadata, *other.metadata} - set(_NO_CONDITION):
        numbers.append((one.metadata.get(name), other.metadata.get(name)))
    if one.protocol.flow != other.protocol.flow or one.quantity != other.quantity:
        return False
    fewer, more = sorted((one, other), key=len)
    times = fewer.time[(fewer.time >= more.time[0]) & (fewer.time <= more.time[-1])]
    if len(times) < _FEWEST_SAMPLES or not all(_alike(*pair) for pair in numbers):
        return False
    if np.ptp(times) < _SHARED * max(np.ptp(one.time), np.ptp(other.time)):
        longer = max((one, other), key=lambda run: run.time[-1])
        times = np.append(times, longer.time[longer.time > times[-1]])
    # between the knots of both protocols before the record: of a step, or a flow
    knots = np.concatenate([run.protocol.table_times for run in (one, other)])
    ahead = np.unique(np.minimum(knots, 0.0))
    for some in (times, 0.5 * (ahead[1:] + ahead[:-1])):
        rates = np.array([shear_rates(run.protocol, some) for run in (one, other)])
        most = np.max(np.abs(rates), initial=0.0)
        if np.max(np.abs(rates[0] - rates[1]), initial=0.0) > _SAME * most:
            return False
    return True


def _alike(one: Any, other: Any) -> bool:
    """Return whether two conditions agree; words say nothing, and a number is to stand in both."""
    are_numbers = [isinstance(value, int | float) for value in (one, other)]
    if not all(are_numbers):
        return not any(are_numbers)
    return one == other or abs(one - other) <= _SAME * max(abs(one), abs(other))


def is_copy(one: Run, other: Run) -> bool:
    """Return whether two runs are one record, but for its name, its digits and samples left out."""
    if one.quantity != other.quantity or one.flow != other.flow:
        return False
    fewer, more = sorted((one, other), key=len)
    if len(fewer) < _FEWEST:
        same = np.array_equal(one.time, other.time)
        return same and np.array_equal(one.recorded, other.recorded)
    at = nearest(more.time, fewer.time)
    close = np.abs(more.time[at] - fewer.time) <= 1e-6 * max(float(fewer.time[-1]), 1e-300)
    if np.mean(close) < 0.9 or np.count_nonzero(close) < _FEWEST:
        return False
    known, found = fewer.recorded[close], more.recorded[at[close]]
    if not np.any(known):
        return False
    off = rms(known - found)
    return off <= _ROUNDED * sample_to_sample_noise(known)


def require_no_copies(fitted: Sequence[Run], held_out: Sequence[Run]) -> None:
    """Refuse to test on a record that is fitted under another name; InputError names both."""
    for run in held_out:
        copied = next((other.name for other in fitted if is_copy(run, other)), None)
        if copied is not None:
            raise InputError(
                f"The held-out run {run.name!r} holds the same samples as the fitted run "
                f"{copied!r}, so it proves nothing. Hold out another, or none."
            )


def require_loadings(runs: Sequence[Run], deviation: float | None) -> None:
    """Refuse runs that cannot each be a loading of its own, by a relative `deviation`."""
    if deviation is None:
        return
    if not 0.0 < deviation <= LARGEST:
        raise InputError(
            f"loading must be above 0 and at most {LARGEST:g}; got {deviation:g}. It is "
            "the relative standard deviation by which loadings of a sample differ, such as 0.03."
        )
    creep = [run.name for run in runs if run.protocol.control == "stress"]
    if creep:
        raise InputError(
            f"loading is a factor on a recorded stress, and the stress of the run {creep[0]!r} was "
            "imposed. Take such runs out, or leave loading out."
        )


def total_strain(run: Run) -> float:
    """Return the strain of a run, added up without regard to its sign."""
    size = np.abs(run.rate)
    # before its first sample a run flows at the rate of that sample
    return float(size[0] * run.time[0]) + float(np.trapezoid(size, run.time))


def in_sequence(runs: Sequence[Run], order: Float[np.ndarray, " runs"]) -> tuple[Run, ...]:
    """Return runs with the strain of those before in `order`, such as start times.

    Runs of equal number in the order are parallel.
    """
    totals = np.array([total_strain(run) for run in runs])
    return tuple(
        replace(run, strain_before=float(np.sum(totals[order < at])))
        for run, at in zip(runs, order, strict=True)
    )
