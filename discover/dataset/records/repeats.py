"""What repeated tests say of their error: loading, trimming and noise together."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.interpolate import PchipInterpolator

from discover.dataset.loading import LARGEST
from discover.dataset.run import Run
from discover.protocols.kinematics import STATES
from discover.protocols.protocol import shear_rates
from discover.statistics.projection import rms

_SAME = 0.02
"""Relative difference of rates, and of what runs.csv says of two runs, that is none."""

_FEWEST_SAMPLES = 10

_SHARED = 0.5
"""Share of the longer run that both must cover for their difference to tell an error of all of it,
or for their rates to be held against each other there alone."""

# What a source counts or sums up of a record, and no condition of the test
_NO_CONDITION = ("n_points", "final_strain", "max_abs_strain", "start_time_in_sequence_s")


@dataclass(frozen=True)
class Repeats:
    """Runs that repeat one another, and by how much they differ.

    `groups`: names of the runs of each test that was repeated, of those whose difference counts.
    `error`: relative error of one run: root-mean-square of the difference of two, over √2 and over
        that of the record; of several tests the root-mean-square.
    """

    groups: tuple[tuple[str, ...], ...]
    error: float


def repeats_among(runs: Sequence[Run]) -> Repeats | None:
    """Return which runs repeat one another and by how much they differ; None where none does.

    Of runs of one test (`repeated_tests`) those tell their error that cover half of each other, and
    differ by no more than loadings do.
    """
    named = {run.name: run for run in runs}
    groups, squares = [], []
    for group in repeated_tests(runs):
        pairs = combinations([named[name] for name in group], 2)
        told = {(one.name, other.name): _difference(one, other) for one, other in pairs}
        told = {pair: error for pair, error in told.items() if error <= LARGEST}
        if told:
            among = {name for pair in told for name in pair}
            groups.append(tuple(name for name in group if name in among))
            squares.append(np.mean(np.square([*told.values()])))
    return Repeats(tuple(groups), float(np.sqrt(np.mean(squares)))) if groups else None


def repeated_tests(runs: Sequence[Run]) -> tuple[tuple[str, ...], ...]:
    """Return the names of the runs of each test that was repeated.

    Two runs are one test if their rates agree, and so does every number that the source gives of
    their conditions. The rates have to agree over all of the longer run, where the shorter would go
    on as it was told, or over the time that both cover if that is half of it.

    `runs`: runs; those of steady or periodic states and those at a given stress are passed over.
    """
    timed = [
        run
        for run in runs
        if run.protocol.control not in (*STATES, "stress") and len(run) >= _FEWEST_SAMPLES
    ]
    groups: list[list[Run]] = []
    for run in timed:
        group = next((group for group in groups if _same_test(group[0], run)), None)
        if group is None:
            groups.append([run])
        else:
            group.append(run)
    return tuple(tuple(run.name for run in group) for group in groups if len(group) > 1)


def count_flows(runs: Sequence[Run]) -> int:
    """Return how many different flows were measured.

    A test that was repeated is one flow. Each steady or periodic state of a table is one.

    `runs`: runs; one that is there several times, with other quantities, counts once.
    """
    named = [*{run.name: run for run in runs}.values()]
    again = sum(len(group) - 1 for group in repeated_tests(named))
    states = sum(len(run) - 1 for run in named if run.protocol.control in STATES)
    return len(named) - again + states


def _same_test(one: Run, other: Run) -> bool:
    if one.protocol.flow != other.protocol.flow or one.quantity != other.quantity:
        return False
    numbers = [(one.rate_before, other.rate_before), (one.strain_before, other.strain_before)]
    for name in {*one.metadata, *other.metadata} - set(_NO_CONDITION):
        pair = one.metadata.get(name), other.metadata.get(name)
        if any(isinstance(value, int | float) for value in pair):
            numbers.append(pair)  # pyright: ignore[reportArgumentType]
    if not all(_alike(*pair) for pair in numbers):
        return False
    times = _common_times(one, other)
    if times is None:
        return False
    longer = max((one, other), key=lambda run: run.time[-1])
    if _share(one, other, times) < _SHARED:
        times = np.append(times, longer.time[longer.time > times[-1]])
    rates = shear_rates(one.protocol, times), shear_rates(other.protocol, times)
    return bool(np.max(np.abs(rates[0] - rates[1])) <= _SAME * np.max(np.abs(rates[0])))


def _share(one: Run, other: Run, times: np.ndarray) -> float:
    """Return how much of the longer of two runs some times cover."""
    longest = max(run.time[-1] - run.time[0] for run in (one, other))
    return float((times[-1] - times[0]) / longest)


def _alike(one: object, other: object) -> bool:
    if not isinstance(one, int | float) or not isinstance(other, int | float):
        return False
    return one == other or abs(one - other) <= _SAME * max(abs(one), abs(other))


def _common_times(one: Run, other: Run) -> np.ndarray | None:
    """Return the times of the run with fewer samples that both cover; None where they are few."""
    fewer, more = sorted((one, other), key=len)
    inside = (fewer.time >= more.time[0]) & (fewer.time <= more.time[-1])
    return fewer.time[inside] if np.count_nonzero(inside) >= _FEWEST_SAMPLES else None


def _difference(one: Run, other: Run) -> float:
    """Return the relative error of one of two runs; infinite where they share too little."""
    times = _common_times(one, other)
    if times is None or _share(one, other, times) < _SHARED:
        return float("inf")
    records = [PchipInterpolator(run.time, run.recorded)(times) for run in (one, other)]
    size = rms(records) or 1.0
    return float(np.sqrt(np.mean((records[0] - records[1]) ** 2) / 2.0)) / size
