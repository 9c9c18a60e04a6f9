"""The lines of a data folder that a block gives, once it is known which test it is."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from discover.dataset.importing.in_time import AT_REST, CONSTANT, spread, strain_of, up_and_down
from discover.dataset.importing.mapping import TestName
from discover.dataset.importing.oscillations import alternates, goes_on
from discover.dataset.importing.quantities import QUANTITIES
from discover.dataset.importing.readings import Readings
from discover.dataset.importing.recognition import Recognised, whole
from discover.errors import InputError

Values = Float[np.ndarray, " n"]

_REACHED = 0.95
"""Share of a step of strain from which on it counts as put on."""


@dataclass
class Record:
    """One test, as the folder will hold it.

    `table`: columns in SI units by quantity, in the order of the file.
    `conditions`: cells of ``runs.csv``.
    `temperature`: mean, in °C; None where nobody says it.
    `dropped`: rows left out, for want of a number or because they cannot be.
    `notes`: what else was done or is to be known, in words.
    """

    kind: TestName
    table: dict[str, Values]
    conditions: dict[str, str] = field(default_factory=dict)
    temperature: float | None = None
    dropped: int = 0
    notes: list[str] = field(default_factory=list)

    @property
    def is_run(self) -> bool:
        """Whether it is a file of ``runs.csv``, not one of the tables beside the runs."""
        return {"time", "stress"} <= set(self.table) or "tensile_stress" in self.table

    @property
    def columns(self) -> dict[str, Values]:
        """The table by the names of columns."""
        return {QUANTITIES[key].column: values for key, values in self.table.items()}


def record(readings: Readings, found: Recognised, before: Record | None) -> Record:
    """Return the test that some rows of a block hold.

    Raises InputError if it lacks what such a test needs; names it.
    """
    made = {
        "frequency_sweep": _frequency_sweep,
        "amplitude_sweep": _amplitude_sweep,
        "flow_curve": _flow_curve,
        "relaxation": _relaxation,
        "creep": _creep,
        "run": _run,
    }[found.kind](readings, found)
    temperature = readings.get("temperature")
    if temperature is not None and np.isfinite(temperature[found.rows]).any():
        made.temperature = float(np.round(np.nanmean(temperature[found.rows]), 1))
    return _after(made, before) if before is not None else made


def _table(
    readings: Readings, found: Recognised, needed: tuple[str, ...], besides: tuple[str, ...] = ()
) -> Record:
    """Return the rows that have a number in every quantity, and how many have not."""
    lacking = [key for key in needed if readings.get(key) is None]
    if lacking:
        what = found.kind.replace("_", " ")
        raise InputError(
            f"{readings.name}, block at line {readings.block.line}: a {what} needs {lacking[0]}, "
            f'and no column is known as it. Name it, as in --column {lacking[0]}="its name", '
            "or take the block for another --test."
        )
    keys = [*needed, *(key for key in besides if readings.has(key))]
    rows = found.rows & whole(readings, *keys)
    if not rows.any():
        raise InputError(
            f"{readings.name}: no row from line {readings.block.line} on has numbers in all of "
            f"{', '.join(keys)}. Name other columns."
        )
    table = {}
    for key in QUANTITIES:
        if key in keys:
            values = readings.get(key)
            assert values is not None
            table[key] = values[rows]
    return Record(found.kind, table, dropped=int(np.sum(found.rows) - np.sum(rows)))


def _keep(made: Record, rows: np.ndarray, why: str) -> None:
    left = int(np.sum(~rows))
    if not rows.any():
        raise InputError(f"No row of a {made.kind.replace('_', ' ')} is left: {why} in every one.")
    if left:
        made.notes.append(f"{left} row{'' if left == 1 else 's'} left out: {why}")
        made.table = {key: values[rows] for key, values in made.table.items()}


def _frequency_sweep(readings: Readings, found: Recognised) -> Record:
    made = _table(readings, found, ("omega", "Gp", "Gpp"))
    positive = np.all([values > 0.0 for values in made.table.values()], axis=0)
    _keep(made, positive, "a modulus that is not positive, beyond the reach of the instrument")
    return made


def _amplitude_sweep(readings: Readings, found: Recognised) -> Record:
    known = readings.has("omega")
    needed = ("strain_amplitude", "omega", "Gp", "Gpp") if known else _WITHOUT_FREQUENCY
    made = _table(readings, found, needed)
    made.table = {"strain": made.table.pop("strain_amplitude"), **made.table}
    _keep(made, made.table["strain"] > 0.0, "no strain")
    if not known:
        made.notes.append(
            "nothing says at which frequency: write amplitude_sweep_rad_s in the study, or a line "
            "such as Frequency: 1 Hz above the numbers"
        )
    return made


_WITHOUT_FREQUENCY = ("strain_amplitude", "Gp", "Gpp")


def _flow_curve(readings: Readings, found: Recognised) -> Record:
    made = _table(readings, found, ("shear_rate", "stress"), ("N1", "N2"))
    time = readings.get("time")
    rate, stress = made.table["shear_rate"], made.table["stress"]
    if np.median(rate) < 0.0 and np.median(stress) < 0.0:
        made.table |= {"shear_rate": -rate, "stress": -stress}
        made.notes.append("rate and stress, both negative, are taken without their signs")
    _keep(made, (made.table["shear_rate"] > 0.0) & (made.table["stress"] > 0.0), "no steady flow")
    ways = up_and_down(made.table["shear_rate"], made.table["stress"])
    if ways is not None:
        made.notes.append(f"the ways up and down in rate are {ways.described}")
    if time is not None and len(time) > 1:
        strains = np.abs(made.table["shear_rate"]) * np.median(np.abs(np.diff(time)))
        few = int(np.sum(strains < 2.0))
        if few:
            made.notes.append(
                f"{few} of {len(strains)} points were held for a strain below 2, where flow may "
                "not be steady"
            )
    return made


def _begin(made: Record, readings: Readings) -> None:
    """Count time from the start of the flow, and leave out times that do not go on."""
    made.table["time"] = made.table["time"] - readings.mapping.start_time_s - readings.begins
    if readings.begins:
        made.notes.append(f"time counts from the last sample before it, at {readings.begins:.4g} s")
    time = made.table["time"]
    later = np.concatenate([[True], time[1:] > np.maximum.accumulate(time)[:-1]])
    if 0 < np.sum(~later) <= max(2, 0.1 * len(time)):
        _keep(made, later, "a time that was there already")


def _run(readings: Readings, found: Recognised) -> Record:
    if readings.has("tensile_stress"):
        made = _table(
            readings,
            found,
            (
                "time",
                "tensile_stress",
                "hencky_rate" if readings.has("hencky_rate") else "hencky_strain",
            ),
        )
        _begin(made, readings)
        flow = next((word for word in ("planar", "biaxial") if word in found.why), "uniaxial")
        made.conditions["flow"] = flow
        made.notes.append(f"taken as {flow}; write another flow in runs.csv if it is not")
        return made
    moved = ("shear_rate",) if readings.has("shear_rate") else ("strain",)
    besides = ("N1", "N2", "strain") if moved[0] == "shear_rate" else ("N1", "N2")
    made = _table(readings, found, ("time", *moved, "stress"), besides)
    _begin(made, readings)
    _start(made)
    return made


def _start(made: Record) -> None:
    """Note whether an oscillation had gone on before the record."""
    time, stress = made.table["time"], made.table["stress"]
    moved = made.table.get("strain", made.table.get("shear_rate"))
    imposed = stress if made.kind == "creep" else moved
    if moved is None or imposed is None or not alternates(imposed) or np.any(np.diff(time) <= 0):
        return
    if goes_on(time, imposed, moved if made.kind == "creep" else stress):
        made.conditions["start"] = "periodic"
        made.notes.append("its cycles repeat from the first sample on: periodic steady state")
    else:
        made.notes.append("taken as an oscillation that starts from rest")


def _creep(readings: Readings, found: Recognised) -> Record:
    moved = "strain" if readings.has("strain") else "shear_rate"
    if not readings.has("stress", moved):
        return _function_of_time(readings, found, "compliance")
    made = _table(readings, found, ("time", "stress", moved))
    _begin(made, readings)
    # the clock of a recovery in the same block may start again
    starts = np.flatnonzero(np.diff(made.table["time"]) < -0.5 * made.table["time"][:-1]) + 1
    first, *others = (
        dict(zip(made.table, piece, strict=True))
        for piece in zip(*(np.split(v, starts) for v in made.table.values()), strict=True)
    )
    made.table = _with_strain(first)
    if moved == "shear_rate":
        made.notes.append("the strain is the integral of the rate from t = 0 on")
    made.conditions["control"] = "stress"
    for other in others:
        made = _followed(made, _with_strain(other))
    _start(made)
    return made


def _with_strain(table: dict[str, Values]) -> dict[str, Values]:
    """Return time, stress and strain, which is the integral of the rate where that stands."""
    strain = table["strain"] if "strain" in table else strain_of(table["time"], table["shear_rate"])
    return {"time": table["time"], "stress": table["stress"], "strain": strain}


def _relaxation(readings: Readings, found: Recognised) -> Record:
    if not readings.has("stress", "strain"):
        return _function_of_time(readings, found, "relaxation_modulus")
    made = _table(readings, found, ("time", "stress", "strain"), ("N1", "N2"))
    _begin(made, readings)
    time, strain = made.table["time"], made.table.pop("strain")
    step = float(np.median(strain[len(strain) // 4 :]))
    reached = int(np.argmax(strain / step >= _REACHED))
    made.conditions["step_strain"] = repr(float(f"{step:.6g}"))
    if reached:
        took = float(time[reached] - min(time[0], 0.0 if time[0] > 0.0 else time[0]))
        made.table["time"] = time - time[reached]
        made.conditions["step_time_s"] = repr(float(f"{took:.6g}"))
        made.notes.append(f"time counts from the end of the step, which took {took:.3g} s")
    _keep(made, made.table["time"] > 0.0, "the step itself")
    return made


def _function_of_time(readings: Readings, found: Recognised, what: str) -> Record:
    """Return a compliance or a modulus as the instrument's software computed it."""
    made = _table(readings, found, ("time", what))
    _begin(made, readings)
    positive = (made.table["time"] > 0.0) & (made.table[what] > 0.0)
    _keep(made, positive, f"no {what.rpartition('_')[2]}")
    return made


def _after(made: Record, before: Record) -> Record:
    """Return a test with what the one before it says of its start."""
    if not (made.is_run and before.is_run) or "flow" in made.conditions or "flow" in before.table:
        return made
    rate_before = before.table.get("shear_rate")
    rate = made.table.get("shear_rate", np.zeros(1))
    if "rate_before_1_s" in before.conditions:
        level = float(before.conditions["rate_before_1_s"])
        if made.kind == "run" and np.median(np.abs(rate)) < AT_REST * abs(level):
            made.kind, made.notes = "none", ["a rest: it goes on from the relaxation before it"]
        return made
    if before.conditions or rate_before is None or not np.median(rate_before):
        return made
    if spread(rate_before) >= CONSTANT:
        return made
    level = float(np.median(rate_before))
    if np.median(np.abs(rate)) < AT_REST * abs(level):
        share = made.table["stress"][0] / before.table["stress"][-1]
        if 0.3 < share < 1.2:
            zeros = np.zeros(len(made.table["time"]))
            made.kind = "run"
            made.table = {
                "time": made.table["time"],
                "shear_rate": zeros,
                "stress": made.table["stress"],
            }
            made.conditions = {"start": "steady", "rate_before_1_s": repr(level)}
            made.notes.append(f"relaxation after the steady flow before it, at {level:.3g} 1/s")
        elif made.kind == "run":
            made.kind, made.notes = "none", ["a rest: no rate, and none of the stress before it"]
        return made
    made.notes.append(
        f"taken as starting from rest, though a flow at {level:.3g} 1/s stands before it"
    )
    return made


def clock_before(readings: Readings, last: float) -> tuple[float, float]:
    """Return when a block began, if its clock goes on from the block before, and when it ended."""
    at = readings.columns.get("time")
    if at is None or readings.mapping.start_time_s:
        return 0.0, last
    try:
        time = readings.get("time")
    except InputError:  # said where the block is read, if it is
        return 0.0, last
    assert time is not None
    time = time[np.isfinite(time)]
    if not len(time):
        return 0.0, last
    whole_clock = "step_time" not in readings.names.find(readings.block.columns[at][0])
    goes_on_from = last if whole_clock and 0.0 < last <= time[0] else 0.0
    return goes_on_from, float(time[-1])


def joined(creep: Record, recovery: Readings) -> Record | None:
    """Return creep and the recovery after it as one test; None if a block is no such recovery."""
    moved = "strain" if recovery.has("strain") else "shear_rate"
    keys = ("time", "stress", moved)
    if creep.conditions.get("control") != "stress" or not recovery.has(*keys):
        return None
    rows = whole(recovery, *keys)
    if not rows.any():
        return None
    table = {key: recovery.get(key)[rows] for key in keys}  # type: ignore[index]
    level = float(np.median(np.abs(creep.table["stress"])))
    if np.percentile(np.abs(table["stress"]), 90.0) > AT_REST * level:
        return None
    table["time"] = table["time"] - recovery.begins
    table["stress"] = np.zeros(int(np.sum(rows)))
    return _followed(creep, _with_strain(table))


def _followed(creep: Record, after: dict[str, Values]) -> Record:
    """Return a test at given stress with what follows; clock and strain may start again."""
    time, strain = after["time"], after["strain"]
    end, last = float(creep.table["time"][-1]), float(creep.table["strain"][-1])
    if abs(strain[0]) < 0.2 * abs(last):  # counted from the start of the recovery
        strain = last + strain if np.median(strain) * last < 0.0 else last - strain
    time = time + end if time[0] < end else time
    later = time > end
    more = {"time": time, "stress": after["stress"], "strain": strain}
    table = {key: np.concatenate([creep.table[key], v[later]]) for key, v in more.items()}
    notes = [*creep.notes, f"with the recovery after {end:.4g} s as one run"]
    return Record("creep", table, creep.conditions, creep.temperature, creep.dropped, notes)
