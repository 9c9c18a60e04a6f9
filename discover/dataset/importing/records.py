"""The lines of a data folder that a block gives, once it is known which test it is."""

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from discover.dataset.importing.mapping import TestName
from discover.dataset.importing.names import tables_of
from discover.dataset.importing.quantities import QUANTITIES, SAME_TEMPERATURE
from discover.dataset.importing.readings import Readings
from discover.dataset.importing.series import (
    AT_REST,
    CONSTANT,
    Values,
    alternates,
    goes_on,
    spread,
    strain_of,
    up_and_down,
)
from discover.dataset.importing.which_test import Recognised
from discover.errors import InputError

Table = dict[str, Values]

_REACHED = 0.95  # share of a step of strain from which on it counts as put on


class _Needed(NamedTuple):
    """What a kind of test has to have, besides, and which rows of it can be."""

    kind: TestName
    keys: tuple[str, ...]
    besides: tuple[str, ...] = ()
    positive: tuple[str, ...] = ()
    why: str = ""  # of rows where something is not positive


_NORMAL, _STEADY = ("N1", "N2"), ("shear_rate", "stress")
_SWEEP, _SIZE = ("omega", "Gp", "Gpp"), ("strain_amplitude",)
_MODULUS, _COMPLIANCE = ("time", "relaxation_modulus"), ("time", "compliance")
_NO_MODULUS = "a modulus that is not positive, beyond the reach of the instrument"
# of one kind that counts of which least is lacking, the first of several
_NEEDED = (
    _Needed("frequency_sweep", _SWEEP, (), _SWEEP, _NO_MODULUS),
    _Needed("amplitude_sweep", (*_SIZE, *_SWEEP), (), _SIZE, "no strain"),
    _Needed("amplitude_sweep", (*_SIZE, "Gp", "Gpp"), (), _SIZE, "no strain"),
    _Needed("flow_curve", _STEADY, _NORMAL, _STEADY, "no steady flow"),
    _Needed("run", ("time", "tensile_stress", "hencky_rate")),
    _Needed("run", ("time", "tensile_stress", "hencky_strain")),
    _Needed("run", ("time", "shear_rate", "stress"), (*_NORMAL, "strain")),
    _Needed("run", ("time", "strain", "stress"), _NORMAL),
    _Needed("relaxation", ("time", "strain", "stress"), _NORMAL),
    _Needed("creep", ("time", "stress", "strain")),
    _Needed("creep", ("time", "stress", "shear_rate")),
    # as the instrument's software computed it
    _Needed("relaxation", _MODULUS, (), _MODULUS, "no modulus"),
    _Needed("creep", _COMPLIANCE, (), _COMPLIANCE, "no compliance"),
)


@dataclass
class Record:
    """One test, as the folder will hold it."""

    kind: TestName
    table: Table  # columns in SI units by quantity, in the order of the file
    conditions: dict[str, str] = field(default_factory=dict)  # cells of runs.csv
    temperature: float | None = None  # mean, in °C; None where nobody says it
    dropped: int = 0  # rows left out, for want of a number or because they cannot be
    notes: list[str] = field(default_factory=list)  # what else was done or is to be known
    name: str = ""  # of its file, if it is a run, without ending
    source: str = ""  # file that it is from
    block: str = ""  # what that calls the block

    @property
    def is_run(self) -> bool:
        """Whether it is a file of ``runs.csv``, not one of the tables beside the runs."""
        return {"time", "stress"} <= set(self.table) or "tensile_stress" in self.table

    @property
    def columns(self) -> Table:
        """The table by the names of columns."""
        return {QUANTITIES[key].column: values for key, values in self.table.items()}

    def near(self, celsius: float | None) -> bool:
        """Return whether it is at a temperature, or nobody says one of the two."""
        has = self.temperature
        return has is None or celsius is None or abs(has - celsius) <= SAME_TEMPERATURE

    def keep(self, rows: np.ndarray, why: str) -> None:
        """Leave out the other rows, with a note why; InputError if none is left."""
        left = int(np.sum(~rows))
        if not rows.any():
            what = self.kind.replace("_", " ")
            raise InputError(f"No row of a {what} is left: {why} in every one.")
        if left:
            self.notes.append(f"{left} row{'' if left == 1 else 's'} left out: {why}")
            self.table = {key: values[rows] for key, values in self.table.items()}


def record(readings: Readings, found: Recognised, before: Record | None) -> Record:
    """Return the test that rows hold, after the one before it; InputError names what it lacks."""
    if found.kind == "none":
        return Record("none", {}, notes=[found.why])
    of_kind = [one for one in _NEEDED if one.kind == found.kind]
    needed = next((one for one in of_kind if readings.has(*one.keys)), None)
    if needed is None:
        needed = min(of_kind, key=lambda one: sum(not readings.has(key) for key in one.keys))
    made = _taken(readings, found, needed)
    if "time" in made.table:
        _begin(made, readings)
    if made.kind == "flow_curve":
        rate, stress = made.table["shear_rate"], made.table["stress"]
        if np.median(rate) < 0.0 and np.median(stress) < 0.0:
            made.table |= {"shear_rate": -rate, "stress": -stress}
            made.notes.append("rate and stress, both negative, are taken without their signs")
    if needed.positive:
        made.keep(np.all([made.table[k] > 0.0 for k in needed.positive], axis=0), needed.why)
    if "tensile_stress" in made.table:
        flow = next((word for word in ("planar", "biaxial") if word in found.why), "uniaxial")
        made.conditions["flow"] = flow
        made.notes.append(f"taken as {flow}; write another flow in runs.csv if it is not")
    elif made.kind == "amplitude_sweep":
        made.table = {"strain": made.table.pop("strain_amplitude"), **made.table}
        if "omega" not in made.table:
            made.notes.append(
                "nothing says at which frequency: write amplitude_sweep_rad_s in the study, or a "
                "line such as Frequency: 1 Hz above the numbers"
            )
    elif made.kind == "flow_curve":
        _note_steadiness(made, readings.get("time"))
    elif made.kind == "relaxation" and made.is_run:
        _after_step(made)
    elif made.kind == "creep" and made.is_run:
        if "strain" not in made.table:
            made.notes.append("the strain is the integral of the rate from t = 0 on")
        made.table, made.conditions["control"] = _with_strain(made.table), "stress"
    if made.kind in ("run", "creep") and "stress" in made.table:
        _note_alternation(made)
    temperature = readings.get("temperature")
    if temperature is not None and np.isfinite(temperature[found.rows]).any():
        made.temperature = float(np.round(np.nanmean(temperature[found.rows]), 1))
    return made if before is None else _after(made, before)


def _taken(readings: Readings, found: Recognised, needed: _Needed) -> Record:
    """Return the rows that have a number in every quantity, and how many have not."""
    values = {key: readings.get(key) for key in (*needed.keys, *needed.besides)}
    lacking = [key for key in needed.keys if values[key] is None]
    if lacking:
        what = found.kind.replace("_", " ")
        raise InputError(
            f"{readings.name}, block at line {readings.block.line}: a {what} needs {lacking[0]}, "
            f'and no column is known as it. Name it, as in --column {lacking[0]}="its name", '
            "or take the block for another --test."
        )
    there = {key: column for key, column in values.items() if column is not None}
    rows = found.rows & np.all([np.isfinite(column) for column in there.values()], axis=0)
    if not rows.any():
        raise InputError(
            f"{readings.name}: no row from line {readings.block.line} on has numbers in all of "
            f"{', '.join(there)}. Name other columns."
        )
    table = {key: there[key][rows] for key in QUANTITIES if key in there}
    dropped, whence = int(np.sum(found.rows) - np.sum(rows)), (readings.name, readings.block.name)
    return Record(found.kind, table, dropped=dropped, source=whence[0], block=whence[1])


def _begin(made: Record, readings: Readings) -> None:
    """Count time from the start of the flow, and leave out times that do not go on."""
    time = made.table["time"] - readings.mapping.start_time_s - readings.begins
    made.table["time"] = time
    if readings.begins:
        made.notes.append(f"time counts from the last sample before it, at {readings.begins:.4g} s")
    later = np.concatenate([[True], time[1:] > np.maximum.accumulate(time)[:-1]])
    if 0 < np.sum(~later) <= max(2, 0.1 * len(time)):
        made.keep(later, "a time that was there already")


def _note_steadiness(made: Record, time: Values | None) -> None:
    rate = made.table["shear_rate"]
    if (ways := up_and_down(rate, made.table["stress"])) is not None:
        made.notes.append(f"the ways up and down in rate are {ways.described}")
    held = 0.0 if time is None or len(time) < 2 else np.median(np.abs(np.diff(time)))
    if held and (few := int(np.sum(np.abs(rate) * held < 2.0))):
        words = f"{few} of {len(rate)} points were held for a strain below 2"
        made.notes.append(f"{words}, where flow may not be steady")


def _note_alternation(made: Record) -> None:
    time, stress = made.table["time"], made.table["stress"]
    moved = made.table.get("strain", made.table.get("shear_rate"))
    imposed, answer = (stress, moved) if made.kind == "creep" else (moved, stress)
    if imposed is None or answer is None or not alternates(imposed) or np.any(np.diff(time) <= 0):
        return
    if goes_on(time, imposed, answer):
        made.conditions["start"] = "periodic"
        made.notes.append("its cycles repeat from the first sample on: periodic steady state")
    else:
        made.notes.append("taken as an oscillation that starts from rest")


def _with_strain(table: Table) -> Table:
    strain = table["strain"] if "strain" in table else strain_of(table["time"], table["shear_rate"])
    return {"time": table["time"], "stress": table["stress"], "strain": strain}


def _after_step(made: Record) -> None:
    """Count time from the end of a step of strain, and leave the step itself out."""
    time, strain = made.table["time"], made.table.pop("strain")
    step = float(np.median(strain[len(strain) // 4 :]))
    reached = int(np.argmax(strain / step >= _REACHED))
    made.conditions["step_strain"] = repr(float(f"{step:.6g}"))
    if reached:
        took = float(time[reached] - min(time[0], 0.0))
        made.table["time"] = time - time[reached]
        made.conditions["step_time_s"] = repr(float(f"{took:.6g}"))
        made.notes.append(f"time counts from the end of the step, which took {took:.3g} s")
    made.keep(made.table["time"] > 0.0, "the step itself")


def _after(made: Record, before: Record) -> Record:
    """Return a test with what the one before it says of its start."""
    if not (made.is_run and before.is_run) or "flow" in made.conditions or "flow" in before.table:
        return made
    rate_before, declared = before.table.get("shear_rate"), before.conditions.get("rate_before_1_s")
    fastest = float(np.median(np.abs(made.table.get("shear_rate", np.zeros(1)))))
    if declared is not None:
        if made.kind == "run" and fastest < AT_REST * abs(float(declared)):
            made.kind, made.notes = "none", ["a rest, which continues the relaxation before it"]
        return made
    if before.conditions or rate_before is None or spread(rate_before) >= CONSTANT:
        return made
    level = float(np.median(rate_before))
    time, stress = made.table["time"], made.table["stress"]
    if fastest >= AT_REST * abs(level):
        words = f"taken as starting from rest, though a flow at {level:.3g} 1/s stands before it"
        made.notes.append(words)
    elif 0.3 < stress[0] / before.table["stress"][-1] < 1.2:
        made.kind = "run"
        made.table = {"time": time, "shear_rate": np.zeros(len(time)), "stress": stress}
        made.conditions = {"start": "steady", "rate_before_1_s": repr(level)}
        made.notes.append(f"relaxation after the steady flow before it, at {level:.3g} 1/s")
    elif made.kind == "run":
        made.kind, made.notes = "none", ["a rest: no rate, and none of the stress before it"]
    return made


def clock_before(readings: Readings, last: float) -> tuple[float, float]:
    """Return when a block began, if its clock goes on from the block before, and when it ended."""
    if "time" not in readings.columns or readings.mapping.start_time_s:
        return 0.0, last
    time = readings.unless_wrong("time")
    time = np.empty(0) if time is None else time[np.isfinite(time)]
    if not len(time):
        return 0.0, last
    name, _ = readings.block.columns[readings.columns["time"]]
    goes_on = "step_time" not in tables_of(name) and 0.0 < last <= time[0]
    return last if goes_on else 0.0, float(time[-1])


def joined(creep: Record, recovery: Readings) -> Record | None:
    """Return creep and the recovery after it as one test; None if a block is no such recovery."""
    keys = ("time", "stress", "strain" if recovery.has("strain") else "shear_rate")
    if creep.conditions.get("control") != "stress" or not recovery.has(*keys):
        return None
    rows = recovery.whole(*keys)
    if not rows.any():
        return None
    table = {key: recovery.known(key)[rows] for key in keys}
    level = float(np.median(np.abs(creep.table["stress"])))
    if np.percentile(np.abs(table["stress"]), 90.0) > AT_REST * level:
        return None
    table |= {"time": table["time"] - recovery.begins, "stress": np.zeros(int(np.sum(rows)))}
    return _followed(creep, _with_strain(table))


def _followed(creep: Record, after: Table) -> Record:
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
    return replace(creep, kind="creep", table=table, notes=notes)
