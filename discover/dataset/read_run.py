"""Read one run of a data folder: its samples, its flow, and what came before them."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from discover.dataset.kind_of_test import DeclaredTest, declared_test
from discover.dataset.records.rates import DEFAULT_WINDOW, differentiate
from discover.dataset.records.thinning import MOST_SAMPLES, thin
from discover.dataset.run import Run
from discover.dataset.run_table import oscillation, wave_of
from discover.dataset.tables import units
from discover.dataset.tables.table import Table, read_table
from discover.errors import InputError, Problems
from discover.protocols.between_samples import sampled_rate
from discover.protocols.control import imposed_stress
from discover.protocols.history import after_alternation, after_step_strain
from discover.protocols.protocol import FlowProtocol, in_flow, start_up

INDEX_FILE = "runs.csv"

# A rate column is a command, repeated, if it varies no more than rounding to text does
_CONSTANT = 1e-6

# From rest a passive fluid cannot return more work than it was given. A record that is noise around
# zero comes near 0, one with the wrong sign near -1
_WRONG_SIGN = -0.5

# Intervals between samples, and a little, that may be missing of a cycle
_NEXT_SAMPLE = 1.5

# Samples that a moving cubic needs
_FEWEST_SMOOTHED = 5

_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")


def read_run(
    root: Path,
    index: Table,
    row: int,
    clock_factor: float = 1.0,
    rate_is_measured: bool = False,
    rate_window: int = DEFAULT_WINDOW,
    rate_before: float | None = None,
) -> Run:
    """Return the run on one line of ``runs.csv``.

    `root`, `index`, `row`: the folder, its ``runs.csv``, and the line, counted from 0. Raises
    InputError if its file is missing or wrong.
    """
    name = index.columns["file"][row]
    table = read_table(root / name, name, f"Add it, or take its line out of {INDEX_FILE}.")
    metadata = _metadata(index, row)
    test = declared_test(index, row, rate_before)
    in_shear = test.flow == "shear"
    _require_columns(table, test)
    time = table.required(units.TIME)
    strain = table.quantity(units.STRAIN if in_shear else units.HENCKY_STRAIN)
    rate, derived = _rate(table, test, time, strain, rate_window)
    stress = table.required(units.SHEAR_STRESS if in_shear else units.TENSILE_STRESS)
    if strain is None and test.step_strain:
        strain = np.full(len(time), test.step_strain)
    if test.control == "rate":
        _check_sign(name, time, rate, stress)
    normal = table.quantity(units.FIRST_NORMAL_STRESS_DIFFERENCE)
    second = table.quantity(units.SECOND_NORMAL_STRESS_DIFFERENCE)
    if len(time) > MOST_SAMPLES:
        keep, metadata["thinned"] = thin(time, rate, stress)
        time, rate, stress = time[keep], rate[keep], stress[keep]
        normal, second, strain = (v if v is None else v[keep] for v in (normal, second, strain))
    if test.control == "stress" and strain is not None:
        protocol, derived, source = _imposed(name, time, stress), True, "what the fluid answered"
    elif derived:
        protocol = sampled_rate(time, rate)
        source = f"derived from strain: moving cubic over {min(rate_window, len(table))} samples"
    else:
        # of a test at a given stress the rate is what the fluid answered
        rate_is_measured = rate_is_measured or test.control == "stress"
        protocol, source = _protocol(time, rate, rate_is_measured)
    metadata["shear_rate_source"] = source
    run = Run(
        name=name,
        time=time,
        protocol=in_flow(protocol, test.flow),
        rate=rate,
        stress=stress,
        first_normal_stress_difference=normal,
        second_normal_stress_difference=second,
        strain=strain,
        clock_factor=float(clock_factor),
        rate_is_measured=derived or rate_is_measured,
        rate_before=test.rate_before,
        metadata=metadata,
    )
    return _begun(run, test, f"Line {index.lines[row]} of {INDEX_FILE}")


_OF_SHEAR = (units.SHEAR_STRESS, units.SHEAR_RATE, units.STRAIN)
_OF_EXTENSION = (units.TENSILE_STRESS, units.HENCKY_RATE, units.HENCKY_STRAIN)
_BESIDE = (units.FIRST_NORMAL_STRESS_DIFFERENCE, units.SECOND_NORMAL_STRESS_DIFFERENCE)


def _require_columns(table: Table, test: DeclaredTest) -> None:
    """Refuse a table with all that is wrong in its columns, and not with the first of it."""
    problems = Problems()
    with problems.collected():
        _checked_time(table)
    stress, *answers = _OF_SHEAR if test.flow == "shear" else _OF_EXTENSION
    absent = []
    for quantity in (*answers, *_BESIDE):
        with problems.collected():
            if table.quantity(quantity) is None:
                absent.append(quantity)
    with problems.collected():
        if all(answer in absent for answer in answers):
            _refuse_another_flow(table, test)  # or a stress of that flow is taken for a slip
        table.required(stress)
    problems.require_none(table.name)


def _imposed(name: str, time: np.ndarray, stress: np.ndarray) -> FlowProtocol:
    try:
        return imposed_stress(time, stress)
    except InputError as error:
        raise InputError(f"{name}: {error}") from error


def _rate(
    table: Table, test: DeclaredTest, time: np.ndarray, strain: np.ndarray | None, window: int
) -> tuple[Float[np.ndarray, " n"], bool]:
    """Return the rate of a run, and whether it is derived from its strain."""
    quantity = units.SHEAR_RATE if test.flow == "shear" else units.HENCKY_RATE
    rate = table.quantity(quantity)
    if rate is not None:
        return rate, False
    if strain is None:
        if test.step_strain:
            return np.zeros(len(time)), False  # held after the step
        # said in the words of the commoner mistake
        strain = table.required(quantity)
    if test.control == "stress" and len(time) < _FEWEST_SMOOTHED:
        # the strain is what is fitted; the rate is only told
        return np.gradient(strain, time) if len(time) > 1 else np.zeros(1), True
    try:
        rate = differentiate(time, strain, window)
    except InputError as error:
        raise InputError(f"{table.name}: {error}") from error
    if not np.all(np.isfinite(rate)):
        raise InputError(
            f"{table.name}: no rate can be derived from its strain and time; their values are too "
            "far apart. Check their units."
        )
    return rate, True


def _refuse_another_flow(table: Table, test: DeclaredTest) -> None:
    other = units.HENCKY_RATE if test.flow == "shear" else units.SHEAR_RATE
    if table.quantity(other) is None:
        return
    meant = "uniaxial, planar or biaxial" if test.flow == "shear" else "shear"
    raise InputError(
        f"{table.name} has a column {other.column}, but {INDEX_FILE} declares {test.flow}. Write "
        f"{meant} in its column flow."
    )


def _begun(run: Run, test: DeclaredTest, where: str) -> Run:
    """Return the run with what came before t = 0, where that is no steady flow."""
    if test.step_strain:
        later = run.time[run.time > 0.0]
        first = float(later[0]) if len(later) else 1.0
        begun = after_step_strain(run.protocol, test.step_strain, first, test.step_time)
        return replace(run, protocol=begun)
    if test.start != "periodic":
        return run
    # a strain that was recorded tells the period better than a rate that is derived from it
    strain = None if run.strain is None else wave_of(run.time, run.strain - np.mean(run.strain))
    wave = strain or oscillation(run)
    if wave is None:
        raise InputError(
            f"{where} declares a periodic start, but the rate of {run.name} does not alternate. "
            "Leave the cell start empty, or correct the rate."
        )
    period = 2.0 * np.pi / wave[0]
    missing = period - (run.time[-1] - run.time[0])
    # one cycle may lack its end, which is its first sample: instruments give n phases of 2 π k/n
    if missing > _NEXT_SAMPLE * np.max(np.diff(run.time)):
        raise InputError(
            f"{where} declares a periodic start, but {run.name} lasts {np.ptp(run.time):.3g} s, "
            f"less than one period ({period:.3g} s), so nobody can say what came before. Give a "
            "whole cycle."
        )
    protocol = _closed(run, period) if missing > 1e-6 * period else run.protocol
    return replace(run, protocol=after_alternation(protocol, period, run.time))


def _closed(run: Run, period: float) -> FlowProtocol:
    """Return what was imposed in a cycle without its end, ended by its first sample."""
    time = np.append(run.time, run.time[0] + period)
    if run.protocol.control == "stress":
        return in_flow(_imposed(run.name, time, np.append(run.stress, run.stress[0])), run.flow)
    return in_flow(sampled_rate(time, np.append(run.rate, run.rate[0])), run.flow)


def _checked_time(table: Table) -> Float[np.ndarray, " n"]:
    time = table.required(units.TIME)
    if time[0] < 0:
        raise InputError(
            f"time in {table.name} must start at or after 0, when the flow starts; line "
            f"{table.lines[0]} holds {time[0]:g} s. Remove what came before the flow."
        )
    backwards = np.flatnonzero(np.diff(time) <= 0)
    if backwards.size:
        row = int(backwards[0]) + 1
        raise InputError(
            f"time in {table.name} must increase strictly; line {table.lines[row]} holds "
            f"{time[row]:g} s after {time[row - 1]:g} s. Sort the rows and remove repeated "
            f"times.{table.like_it(backwards + 1)}"
        )
    return time


def _check_sign(name: str, time: np.ndarray, rate: np.ndarray, stress: np.ndarray) -> None:
    """Refuse a record in which the fluid drives the rheometer."""
    if len(time) < 2:
        return
    power = rate * stress
    work, size = np.trapezoid(power, time), np.trapezoid(np.abs(power), time)
    if work < _WRONG_SIGN * size:
        raise InputError(
            f"The stress in {name} is opposite to the shear rate over most of the run: the fluid "
            "would drive the rheometer. Change the sign of one of the two columns."
        )


def _protocol(
    time: np.ndarray, rate: np.ndarray, rate_is_measured: bool
) -> tuple[FlowProtocol, str]:
    level = float(np.median(rate))
    if np.ptp(rate) <= _CONSTANT * abs(level):
        return start_up(level), "measured, constant" if rate_is_measured else "commanded, constant"
    protocol = sampled_rate(time, rate)
    between = "a cubic spline" if len(protocol.table_times) > len(time) else "linear"
    return protocol, f"read sample by sample, {between} between samples"


def _metadata(index: Table, row: int) -> dict[str, float | str]:
    metadata: dict[str, float | str] = {}
    for column, cells in index.columns.items():
        if column == "file":
            continue
        # float() would also read 1_2, nan or inf, which are labels here
        cell = cells[row]
        metadata[column] = float(cell) if _NUMBER.fullmatch(cell) else cell
    return metadata
