"""Read one run of a data folder: which test it is, its samples, its rate, and what came before."""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from discover.dataset.records.thinning import MOST_SAMPLES, thin
from discover.dataset.run import TEMPERATURE, Run
from discover.dataset.run_table import oscillation, wave_of
from discover.dataset.tables import units
from discover.dataset.tables.table import Table, is_number, read_table
from discover.errors import InputError, Problems
from discover.protocols.between_samples import sampled_rate
from discover.protocols.control import imposed_stress
from discover.protocols.history import after_alternation, after_step_strain
from discover.protocols.kinematics import KINDS
from discover.protocols.protocol import FlowProtocol, in_flow, start_up
from discover.words import counted, did_you_mean

INDEX_FILE = "runs.csv"

WINDOW = 15  # samples over which the strain is taken to be a cubic in time
_DEGREE = 3
_CHUNK = 50_000

# columns of runs.csv that say what was done, with their values; the first is the default
_VALUES = {"flow": KINDS, "control": ("rate", "stress"), "start": ("rest", "periodic", "steady")}
_LARGEST_STEP = 1000.0  # strain beyond which a step is a slip of unit, such as per cent
# A rate column is a command, repeated, if it varies no more than rounding to text does
_CONSTANT = 1e-6
# From rest a passive fluid cannot return more work than it was given. A record that is noise around
# zero comes near 0, one with the wrong sign near -1
_WRONG_SIGN = -0.5
_NEXT_SAMPLE = 1.5  # intervals between samples, and a little, that may be missing of a cycle

_OF_SHEAR = (units.SHEAR_STRESS, units.SHEAR_RATE, units.STRAIN)
_OF_EXTENSION = (units.TENSILE_STRESS, units.HENCKY_RATE, units.HENCKY_STRAIN)

Values = Float[np.ndarray, " n"]


class SetAside(InputError):
    """Why a run cannot be fitted, though nothing is wrong with it."""


class DeclaredTest(NamedTuple):
    """What a line of ``runs.csv`` says was done."""

    flow: str
    control: str
    start: str
    step_strain: float  # put on before t = 0; zero where there was none
    step_time: float  # over which it was put on, in s; zero is at once
    rate_before: float  # of the steady flow before t = 0, in 1/s


def declared_test(index: Table, row: int, rate_before: float | None) -> DeclaredTest:
    """Return which test the run on a line of ``runs.csv``, from 0, is; InputError if it is none.

    Raises SetAside if a steady flow came before it and nobody says its rate.
    """
    flow, control, start = (_word(index, row, column) for column in _VALUES)
    step, time = (_number(index, row, column) for column in ("step_strain", "step_time_s"))
    where = f"Line {index.lines[row]} of {index.name}"
    if abs(step) > _LARGEST_STEP:
        raise InputError(
            f"{where}: step_strain is {step:g}. A strain is a pure number, 1 for 100 %; correct it."
        )
    if time < 0.0:
        raise InputError(f"{where}: step_time_s is {time:g}. Give a time from 0 on.")
    both = ""
    if step and (start != "rest" or rate_before):
        both = "a step of strain and a flow before it"
    elif start == "periodic" and rate_before:
        both = "an oscillation and a steady flow before t = 0"
    if both:
        raise InputError(f"{where} declares both {both}. Leave one of them out.")
    for column in TEMPERATURE:
        if _number(index, row, column) < units.ABSOLUTE_ZERO:
            raise InputError(
                f"{where}: {column} is {_cell(index, row, column)}, below absolute zero "
                f"({units.ABSOLUTE_ZERO} °C). Write a temperature in °C, or leave the cell empty."
            )
    if start == "steady" and rate_before is None:
        raise SetAside(
            "it starts from a steady flow; name the column of runs.csv that holds the rate of that "
            "flow in the study (rate_before)"
        )
    return DeclaredTest(flow, control, start, step, time, rate_before or 0.0)


def _word(index: Table, row: int, column: str) -> str:
    values, cell = _VALUES[column], _cell(index, row, column)
    if column == "start" and is_number(cell):
        return values[0]  # a time at which the run started, as `sequence` takes it
    if cell and cell not in values:
        raise InputError(
            f"{column} in {index.name} holds {cell!r} on line {index.lines[row]}."
            f"{did_you_mean(cell, values)} Write one of "
            f"{', '.join(values)}; an empty cell is {values[0]}."
        )
    return cell or values[0]


def _number(index: Table, row: int, column: str) -> float:
    cell = _cell(index, row, column)
    if cell and not is_number(cell):
        raise InputError(
            f"{column} in {index.name} holds {cell!r} on line {index.lines[row]}. Write a number, "
            "or leave the cell empty."
        )
    return float(cell or 0.0)


def _cell(index: Table, row: int, column: str) -> str:
    return index.columns[column][row].strip() if column in index.columns else ""


def table_of_run(root: Path, name: str) -> Table:
    """Return the samples of a run as text; InputError if its file is missing or no table."""
    return read_table(root / name, name, f"Add it, or take its line out of {INDEX_FILE}.")


def read_run(
    table: Table, index: Table, row: int, clock_factor: float = 1.0, rate_is_measured: bool = False,
    rate_before: float | None = None,
) -> Run:  # fmt: skip
    """Return the run on a line of ``runs.csv`` from its samples; InputError if they are wrong."""
    name = table.name
    # float() would also read 1_2, nan or inf, which are labels here
    cells = {column: cells[row] for column, cells in index.columns.items() if column != "file"}
    metadata: dict[str, float | str] = {
        column: float(cell) if is_number(cell) else cell for column, cell in cells.items()
    }
    test = declared_test(index, row, rate_before)
    where = f"Line {index.lines[row]} of {INDEX_FILE}"
    time, stress, (rate, strain, *normal) = _columns(table, test, where)
    derived = False
    if rate is None:
        rate, derived = _rate(table, test, time, strain)
    if strain is None and test.step_strain:
        strain = np.full(len(time), test.step_strain)
    if test.control == "rate":
        _check_sign(name, time, rate, stress)
    if len(time) > MOST_SAMPLES:
        keep, metadata["thinned"] = thin(time, rate, stress)
        time, rate, stress = time[keep], rate[keep], stress[keep]
        strain, *normal = (v if v is None else v[keep] for v in (strain, *normal))
    # of a test at a given stress the rate is what the fluid answered
    measured = rate_is_measured or derived or test.control == "stress"
    if test.control == "stress":
        protocol, source = _imposed(name, time, stress), "what the fluid answered"
    elif derived:
        protocol = sampled_rate(time, rate)
        source = f"derived from strain: moving cubic over {min(WINDOW, len(table))} samples"
    elif np.ptp(rate) <= _CONSTANT * abs(level := float(np.median(rate))):
        protocol = start_up(level)
        source = "measured, constant" if measured else "commanded, constant"
    else:
        protocol = sampled_rate(time, rate)
        between = "a cubic spline" if len(protocol.table_times) > len(time) else "linear"
        source = f"read sample by sample, {between} between samples"
    metadata["shear_rate_source"] = source
    run = Run(
        name=name, time=time, protocol=in_flow(protocol, test.flow), rate=rate, stress=stress,
        first_normal_stress_difference=normal[0], second_normal_stress_difference=normal[1],
        strain=strain, clock_factor=clock_factor, rate_is_measured=measured,
        rate_before=test.rate_before, metadata=metadata,
    )  # fmt: skip
    return _begun(run, test, where)


def _columns(
    table: Table, test: DeclaredTest, where: str
) -> tuple[Values, Values, list[Values | None]]:
    """Time, stress, and rate, strain, N1 and N2 or None; InputError with all that is wrong.

    `where`: the line of ``runs.csv`` that declares the test.
    """
    problems, found = Problems(), {}
    time = stress = np.empty(0)
    imposed, *answers = _OF_SHEAR if test.flow == "shear" else _OF_EXTENSION
    with problems.collected():
        time = table.required(units.TIME)
        _check_time(table, time)
    for quantity in (*answers, *units.NORMAL_STRESS_DIFFERENCES):
        with problems.collected():
            found[quantity] = table.quantity(quantity)
    with problems.collected():
        if all(found.get(answer, time) is None for answer in answers):
            _refuse_another_flow(table, test)  # or a stress of that flow is taken for a slip
        strain = answers[-1]
        # what is not in `found` is there and wrong, which is said already
        if test.control == "stress" and strain in found and found[strain] is None:
            problems.add(
                f"{where} declares control = stress, but {table.name} has no column "
                f"{strain.column}, which is what is fitted of a test at a given stress; its "
                f"columns are {table.listed}. Add the strain that was recorded, or leave the cell "
                "control empty if the rate was imposed."
            )
        stress = table.required(imposed)
    problems.require_none(table.name)
    return time, stress, list(found.values())


def _imposed(name: str, time: Values, stress: Values) -> FlowProtocol:
    try:
        return imposed_stress(time, stress)
    except InputError as error:
        raise InputError(f"{name}: {error}") from error


def _rate(
    table: Table, test: DeclaredTest, time: Values, strain: Values | None
) -> tuple[Values, bool]:
    """Return the rate of a run that records none, and whether it is derived from its strain."""
    if strain is None:
        if test.step_strain:
            return np.zeros(len(time)), False  # held after the step
        # said in the words of the commoner mistake
        strain = table.required(units.SHEAR_RATE if test.flow == "shear" else units.HENCKY_RATE)
    if test.control == "stress" and len(time) < _DEGREE + 2:
        # the strain is what is fitted; the rate is only told
        return np.gradient(strain, time) if len(time) > 1 else np.zeros(1), True
    try:
        rate = differentiate(time, strain)
    except InputError as error:
        raise InputError(f"{table.name}: {error}") from error
    if not np.all(np.isfinite(rate)):
        raise InputError(
            f"{table.name}: no rate can be derived from its strain and time; their values are too "
            "far apart. Check their units."
        )
    return rate, True


def differentiate(time: Values, values: Values) -> Values:
    """Return the time derivative of a noisy record, from a moving cubic fit.

    The cubic is that of the `WINDOW` samples nearest in order   [Savitzky & Golay 1964, Anal. Chem.
    36, 1627, for any spacing]. Raises InputError if there are fewer than five.
    """
    n = len(time)
    if n < _DEGREE + 2:
        raise InputError(
            f"A rate cannot be derived from {counted(n, 'sample')} of strain; give at least 5, or "
            "a column shear_rate_1_s."
        )
    window = min(WINDOW, n)
    slopes = []
    # a window of its own for each sample: in parts, so that a million samples fit in memory
    for samples in np.split(np.arange(n), np.arange(_CHUNK, n, _CHUNK)):
        first = np.clip(samples - window // 2, 0, n - window)
        index = first[:, None] + np.arange(window)
        offset = time[index] - time[samples, None]
        # scaled to the window's width: the normal equations stay well conditioned
        width = np.max(np.abs(offset), axis=1, keepdims=True)
        powers = (offset / width)[:, :, None] ** np.arange(_DEGREE + 1)
        basis, triangle = np.linalg.qr(powers)
        projected = np.einsum("nwk,nw->nk", basis, values[index])
        coefficients = np.linalg.solve(triangle, projected[:, :, None])[:, :, 0]
        slopes.append(coefficients[:, 1] / width[:, 0])
    return np.concatenate(slopes)


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
            f"less than one period ({period:.3g} s), so the state before it is unknown. Give a "
            "whole cycle."
        )
    protocol = run.protocol
    if missing > 1e-6 * period:  # ended by its first sample
        by_stress = protocol.control == "stress"
        imposed = run.stress if by_stress else run.rate
        cycle = np.append(run.time, run.time[0] + period), np.append(imposed, imposed[0])
        closed = _imposed(run.name, *cycle) if by_stress else sampled_rate(*cycle)
        protocol = in_flow(closed, run.flow)
    return replace(run, protocol=after_alternation(protocol, period, run.time))


def _check_time(table: Table, time: Values) -> None:
    if time[0] < 0:
        raise InputError(
            f"time in {table.name} must start at or after 0, when the flow starts; line "
            f"{table.lines[0]} holds {time[0]:g} s. Remove what came before the flow."
        )
    backwards = np.flatnonzero(np.diff(time) <= 0) + 1
    if backwards.size:
        row = int(backwards[0])
        raise InputError(
            f"time in {table.name} must increase strictly; line {table.lines[row]} holds "
            f"{time[row]:g} s after {time[row - 1]:g} s. Sort the rows and remove repeated "
            f"times.{table.like_it(backwards)}"
        )


def _check_sign(name: str, time: Values, rate: Values, stress: Values) -> None:
    power = rate * stress
    work, size = np.trapezoid(power, time), np.trapezoid(np.abs(power), time)
    if len(time) > 1 and work < _WRONG_SIGN * size:
        raise InputError(
            f"The stress in {name} is opposite to the shear rate over most of the run: the fluid "
            "would drive the rheometer. Change the sign of one of the two columns."
        )
